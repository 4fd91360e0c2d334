"""Replay pages of one flight by four makers: weight, time to the first frame, frames a second by software.

    uv run --dev --with k3d --with viser --with plotly python benchmarks/replay_pages.py

Each shows the flip in roll with its path and a vehicle of four discs that moves; ours shows more. A frame
counts where something is drawn by WebGL in it; the system's chromium draws by SwiftShader.
"""

import shutil
import tempfile
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

import aerobat as ab
from aerobat import so3

SIZE = (1280, 720)
SECONDS = 5.0  # of counting frames
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
]
COUNTER = """
window.countedFrames = 0; window.firstFrame = null; let seen = false;
for (const kind of [WebGLRenderingContext, WebGL2RenderingContext])
  for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"]) {
    const draw = kind.prototype[name];
    if (draw) kind.prototype[name] = function (...rest) {
      if (!seen) { seen = true; window.countedFrames += 1; window.firstFrame ??= performance.now(); }
      return draw.apply(this, rest);
    };
  }
const tick = () => { seen = false; requestAnimationFrame(tick); };
requestAnimationFrame(tick);
"""
PLAY = {
    "aerobat": "replay.speed = 0.05, replay.toggle()",
    "k3d": "window.plot.startAutoPlay()",
    "viser": "document.querySelector('button').click()",
    "plotly": "Plotly.animate(document.querySelector('.plotly-graph-div'), null, {frame: {duration: 33}})",
}


def discs(vehicle: ab.Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of the rotors' discs."""
    turn = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    vertices, triangles = [], []
    for rotor in vehicle.rotors:
        rim = rotor.radius * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        triangles += [
            (25 * len(vertices), 25 * len(vertices) + 1 + k, 25 * len(vertices) + 1 + (k + 1) % 24)
            for k in range(24)
        ]
        vertices.append(rotor.position_body + np.concatenate([np.zeros((1, 3)), rim]))
    return np.concatenate(vertices), np.array(triangles)


def by_aerobat(flight: ab.Flight, plan: ab.Plan) -> str:
    return ab.view(flight, plan).html


def by_k3d(flight: ab.Flight, plan: ab.Plan) -> str:
    import k3d

    vertices, triangles = discs(plan.vehicle)
    plot = k3d.plot()
    mesh = k3d.mesh(vertices.astype(np.float32), triangles.astype(np.uint32), side="double")
    matrices = np.tile(np.eye(4, dtype=np.float32), (len(flight.times), 1, 1))
    matrices[:, :3, :3] = so3.axes(flight.q_world_body)
    matrices[:, :3, 3] = flight.position
    mesh.model_matrix = {str(t): m for t, m in zip(flight.times.tolist(), matrices, strict=True)}
    plot += mesh
    plot += k3d.line(flight.position.astype(np.float32), width=0.03, shader="mesh")
    return plot.get_snapshot(9, additional_js_code="window.plot = K3DInstance;")


def by_viser(flight: ab.Flight, plan: ab.Plan) -> str:
    import viser

    vertices, triangles = discs(plan.vehicle)
    server = viser.ViserServer(host="127.0.0.1", verbose=False)
    try:
        serializer = server.get_scene_serializer()
        mesh = server.scene.add_mesh_simple("/vehicle", vertices, triangles, side="double")
        pieces = np.stack([flight.position[:-1], flight.position[1:]], axis=1)
        server.scene.add_line_segments("/path", pieces, colors=(0, 68, 136))
        steps = np.diff(flight.times, append=flight.times[-1])
        for p, q, dt in zip(flight.position, flight.q_world_body, steps, strict=True):
            mesh.position, mesh.wxyz = p, q
            serializer.insert_sleep(float(dt))
        return serializer.as_html()
    finally:
        server.stop()


def by_plotly(flight: ab.Flight, plan: ab.Plan) -> str:
    import plotly.graph_objects as go

    vertices, triangles = discs(plan.vehicle)
    rows = np.arange(0, len(flight.times), 8)  # 60 frames a second: each carries all its vertices

    def mesh(k: int) -> go.Mesh3d:
        x, y, z = (flight.position[k] + so3.rotate(flight.q_world_body[k], vertices)).T
        return go.Mesh3d(x=x, y=y, z=z, i=triangles[:, 0], j=triangles[:, 1], k=triangles[:, 2])

    x, y, z = flight.position.T
    path = go.Scatter3d(x=x, y=y, z=z, mode="lines")
    figure = go.Figure([mesh(0), path], frames=[go.Frame(data=[mesh(k)], traces=[0]) for k in rows])
    return figure.to_html(include_plotlyjs=True, auto_play=False)


def main() -> None:
    plan = ab.plan("flip-roll", vehicle="agile-quad")
    flight = ab.fly(plan, rate=500.0)
    makers = {"aerobat": by_aerobat, "k3d": by_k3d, "viser": by_viser, "plotly": by_plotly}
    print(f"{'':10}{'MB':>8}{'made in s':>11}{'first frame s':>15}{'frames / s':>12}{'requests':>10}")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        for name, maker in makers.items():
            began = time.process_time()
            page_text = maker(flight, plan)
            made = time.process_time() - began
            file = Path(folder) / f"{name}.html"
            file.write_text(page_text, encoding="utf-8")
            browser = tools.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
            page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
            asked: list[str] = []
            page.on("request", lambda request, asked=asked: asked.append(request.url))
            page.add_init_script(COUNTER)
            page.goto(file.as_uri(), timeout=120_000)
            while page.evaluate("window.firstFrame") is None:
                page.wait_for_timeout(50)
            page.wait_for_timeout(2000)
            first = page.evaluate("window.firstFrame") / 1000
            page.evaluate(f"(() => {{ {PLAY[name]} }})()")
            before, start = page.evaluate("[window.countedFrames, performance.now()]")
            page.wait_for_timeout(1000 * SECONDS)
            after, end = page.evaluate("[window.countedFrames, performance.now()]")
            outside = sum(not url.startswith(("file:", "blob:", "data:")) for url in asked)
            rate = 1000 * (after - before) / (end - start)
            weight = len(page_text.encode()) / 1e6
            print(f"{name:10}{weight:8.2f}{made:11.2f}{first:15.2f}{rate:12.1f}{outside:10}")
            browser.close()


if __name__ == "__main__":
    main()
