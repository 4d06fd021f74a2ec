"""The mapper's results on the bus: contour, features, grid tiles and its own status, for late joiners too."""

from collections.abc import Iterable

import zenoh

from noctule import keys
from noctule.bus import StatePublisher
from noctule.messages_pb2 import Contour, Features, GridTile, ServiceStatus


class MapPublisher:
    """The keys of one site's map, and of the service that makes it."""

    def __init__(self, session: zenoh.Session, site: str, service: str) -> None:
        self._session = session
        self._site = site
        self._contour = StatePublisher(session, keys.contour(site), Contour)
        self._features = StatePublisher(session, keys.features(site), Features)
        self.status = StatePublisher(session, keys.service_status(site, service), ServiceStatus)
        self._tiles: dict[str, StatePublisher] = {}

    def publish_map(self, contour: Contour, features: Features, changed_tiles: Iterable[GridTile]) -> None:
        """Publish a new state of the map. May wait for a congested link.

        A tile that holds nothing any more is told once, and then there is none for late joiners.
        """
        for tile in changed_tiles:
            name = keys.tile_name(tile.tile_x, tile.tile_y)
            self._tile(name).put(tile)
            if not any(tile.occupied) and not any(tile.free):
                self._tiles.pop(name).close()
        self._features.put(features)
        self._contour.put(contour)

    def publish_status(self, status: ServiceStatus) -> None:
        """Publish how the service fares."""
        self.status.put(status)

    def close(self) -> None:
        """Publish and answer no more."""
        for publisher in (self._contour, self._features, self.status, *self._tiles.values()):
            publisher.close()

    def _tile(self, name: str) -> StatePublisher:
        if name not in self._tiles:
            self._tiles[name] = StatePublisher(self._session, keys.grid(self._site, name), GridTile)
        return self._tiles[name]
