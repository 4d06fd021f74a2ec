"""An extra service in ten lines: tells of every sweep, and of every wall that the mapper finds."""

import sys
import threading

import noctule

site, *routers = sys.argv[1:]
with noctule.Client(site, connect=routers) as client:
    client.on_sweep(lambda sweep: print(f"{sweep.unit}: {len(sweep.readings)} readings", flush=True))
    client.on_contour(
        lambda contour: print("walls", [round(wall.rho_m, 2) for wall in contour.walls], "m away", flush=True)
    )
    threading.Event().wait()
