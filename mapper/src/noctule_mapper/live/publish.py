"""The mapper's results on the bus: contour, features, grid tiles and its own status, for late joiners too."""

from collections.abc import Iterable

import zenoh

from noctule import bounds, keys
from noctule.bus import StatePublisher, StatesPublisher
from noctule.messages_pb2 import Contour, Features, GridTile, ServiceStatus


class MapPublisher:
    """The keys of one site's map, and of the service that makes it."""

    def __init__(self, session: zenoh.Session, site: str, service: str) -> None:
        self._site = site
        self._contour = StatePublisher(session, keys.contour(site), Contour)
        self._features = StatePublisher(session, keys.features(site), Features)
        self.status = StatePublisher(session, keys.service_status(site, service), ServiceStatus)
        self._tiles = StatesPublisher(session, keys.grid(site), GridTile, bounds.MAX_TILES)

    def publish_map(self, contour: Contour, features: Features, changed_tiles: Iterable[GridTile]) -> None:
        """Publish a new state of the map. May wait for a congested link.

        A tile that holds nothing any more is published once, and then there is none for late joiners. Of a map of more
        than MAX_TILES tiles the others are not published.
        """
        for tile in sorted(changed_tiles, key=_holds_anything):  # what is gone makes room
            key = keys.grid(self._site, keys.tile_name(tile.tile_x, tile.tile_y))
            self._tiles.put(key, tile)
            if not _holds_anything(tile):
                self._tiles.forget(key)
        self._features.put(features)
        self.publish_contour(contour)

    def publish_contour(self, contour: Contour) -> None:
        """Publish a contour alone."""
        self._contour.put(contour)

    def publish_status(self, status: ServiceStatus) -> None:
        """Publish how the service fares."""
        self.status.put(status)

    def detail(self) -> str:
        """What of the map is not published; empty where all of it is."""
        refused = self._tiles.refused
        return f"{refused} grid tiles are not published: the map has over {bounds.MAX_TILES}" if refused else ""

    def close(self) -> None:
        """Publish and answer no more."""
        for publisher in (self._contour, self._features, self.status, self._tiles):
            publisher.close()


def _holds_anything(tile: GridTile) -> bool:
    return any(tile.occupied) or any(tile.free)
