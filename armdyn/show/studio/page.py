"""The studio's page: widgets and server of viser around a session."""

import io
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import viser
import websockets.asyncio.server

from armdyn.errors import ArmdynError
from armdyn.models.scene.obstacles import Obstacle
from armdyn.show.page.scene import playing_speed, short_names
from armdyn.show.studio.incoming import guard
from armdyn.show.studio.origins import foreign
from armdyn.show.studio.scene import SceneView
from armdyn.show.studio.session import END_NAMES, End, Session
from armdyn.show.studio.state import (
    MOST_PAYLOAD,
    MOST_RESERVE,
    SIZES,
    moved,
    new_obstacle,
    placement_of,
    resized,
    sizes_of,
    slider_limits,
)
from armdyn.show.studio.words import answer_html, note_html

_FRAME = 1 / 30
"""Between two frames [s]."""
_SLIDER_EVERY = 3
"""Frames between two updates of the time's slider: the browser lays out the panel anew for each."""
_REST = 0.6
"""At the end of the motion, before it is played again [s]."""
_LET_GO = 3.0
"""Time without motion after which a gizmo counts as released [s]: its browser may have been closed."""
_STEP = 1e-3
"""Of the joints' sliders [rad or m]."""
_PHONE = 600
"""A browser less wide has the widgets at its bottom [pixels]."""
_CLOSING = 0.5
"""For browsers to be told of the end [s]."""
_NONE = "none"


def serve(session: Session, host: str, port: int, serving: Callable[[int], None]) -> None:
    """Serve the page until Ctrl-C.

    Args:
        session: entered already: its process is forked before the server's threads are there.
        host: address to listen on.
        port: the first one that is tried.
        serving: called with the port, when the page can be opened.
    """
    with redirect_stdout(io.StringIO()), _same_origin(host):  # viser prints a banner
        server = viser.ViserServer(host, port, label=f"{session.robot.name} – armdyn studio", verbose=False)
    try:
        guard(server)
        page = Page(server, session)
        serving(server.get_port())
        with redirect_stdout(sys.stderr):  # viser prints of browsers that it refuses
            page.run()
    finally:
        with redirect_stdout(io.StringIO()):
            end = threading.Thread(target=server.stop, daemon=True)  # which waits 6 s for clients that do not answer
            end.start()
            end.join(_CLOSING)


class Page:
    """Widgets and scene of a session, the same in all browsers.

    Callbacks of widgets only queue an action with its value; `run`, in the main thread, does it, once
    per frame. A widget that a browser has changed since the last frame began is not written to before that is done.
    """

    def __init__(self, server: viser.ViserServer, session: Session):
        self._server, self._session = server, session
        self._notes: dict[str, Callable[[], object]] = {}
        self._drawn: dict[str, object] = {}
        self._known: dict[str, object] = {}
        self._held: dict[str, float] = {}
        self._selected: str | None = None
        self._time, self._playing, self._frames = 0.0, True, 0
        server.request_share_url = lambda verbose=True: None  # nothing leaves this machine
        # The theme is the server's, one for all browsers, and does not follow theirs: it stays light.
        server.gui.configure_theme(show_share_button=False, show_logo=False, brand_color=(30, 110, 200))
        self.view = SceneView(server.scene, session)
        self._look()
        self._add_widgets()
        for end in END_NAMES:
            self._watch_gizmo(end, self.view.gizmos[end], partial(self._drag_end, end))
        self._watch_gizmo("mover", self.view.mover, self._drag_obstacle)
        self.tick(0.0)

    def run(self) -> None:
        """Handle events and draw, frame by frame."""
        before = time.monotonic()
        while True:
            time.sleep(_FRAME)
            now = time.monotonic()
            self.tick(now - before)
            before = now

    def tick(self, seconds: float) -> None:
        """One frame, some seconds after the last one [s]."""
        for key in list(self._notes):
            try:
                self._notes.pop(key)()
            except ArmdynError as error:
                self._session.change(str(error))
        self._session.tick()
        with self._server.atomic():
            self._show_state()
            self._show_motion()
            if self._server.get_clients():
                self._play(seconds)

    # Widgets.

    def _add_widgets(self) -> None:
        gui, session = self._server.gui, self._session
        self._answer = gui.add_html("")
        self._play_button = gui.add_button("Pause", hint="P on the keyboard")
        self._play_button.on_click(self._note("play", self._toggle))
        gui.add_command("Play or pause", hotkey="P").on_trigger(self._note("play", self._toggle))
        self._clock = gui.add_slider("time [s]", 0.0, 1.0, 1e-3, 0.0)
        self._on_update(self._clock, self._seek)
        speeds = ("1", "1/2", "1/5", "1/10", "1/50", "1/200")
        self._speed = gui.add_dropdown("speed", speeds, initial_value="1/5", hint="of real time")
        tabs = gui.add_tab_group()
        self._sliders = {}
        for end, label in (("goal", "Goal"), ("start", "Start")):
            with tabs.add_tab(label):
                self._sliders[end] = self._add_sliders(end)
        with tabs.add_tab("Obstacles"):
            self._add_obstacle_widgets()
        with tabs.add_tab("Limits"):
            self._add_limit_widgets()
        with gui.add_folder("Save"):
            self._saved = gui.add_html("")
            for label, save in (
                ("Problem (TOML)", session.save_problem),
                ("Motion (npz)", session.save_motion),
                ("Report (HTML)", session.save_report),
            ):
                gui.add_button(label).on_click(partial(self._save, save))

    def _add_sliders(self, end: Any) -> list[Any]:
        session, gui = self._session, self._server.gui
        robot, q = session.robot, getattr(session.state, end)
        poses = {name: pose for name, pose in robot.poses.items() if np.all(np.isfinite(pose))}
        if poses:
            chosen = gui.add_dropdown("pose", (_NONE, *poses), hint="Named poses of the robot")
            self._on_update(chosen, lambda name: session.change(**{end: poses.get(name, getattr(session.state, end))}))
        lower, upper = slider_limits(session.setup.problem)
        sliders = []
        for i, name in enumerate(short_names(robot.joint_names)):
            unit = "m" if robot.slides[i] else "rad"
            range_of_joint = float(lower[i]), float(upper[i])
            at = _fitting(q[i], *range_of_joint)
            one = gui.add_slider(f"{name} [{unit}]", *range_of_joint, _STEP, at, hint=robot.joint_names[i])
            sliders.append(one)
            self._on_update(one, partial(self._turn, end, i))
        return sliders

    def _add_obstacle_widgets(self) -> None:
        gui = self._server.gui
        self._kind = gui.add_dropdown("shape", tuple(SIZES))
        gui.add_button("Add obstacle").on_click(self._note("add", self._add_obstacle))
        self._choice = gui.add_dropdown("selected", (_NONE,))
        self._on_update(self._choice, self._select)
        self._position = gui.add_vector3("position [m]", (0.0, 0.0, 0.0), step=0.01)
        self._on_update(self._position, self._shift)
        self._sizes = [gui.add_number("size [m]", 0.1, min=1e-3, step=0.01) for _ in range(3)]
        for k, one in enumerate(self._sizes):
            self._on_update(one, partial(self._resize, k))
        self._remove = gui.add_button("Remove obstacle")
        self._remove.on_click(self._note("remove", self._remove_obstacle))

    def _add_limit_widgets(self) -> None:
        gui, session, state = self._server.gui, self._session, self._session.state
        payload = gui.add_number("payload [kg]", float(state.payload), min=0.0, max=MOST_PAYLOAD, step=0.1)
        reserve = gui.add_slider(
            "reserve", 0.0, MOST_RESERVE, 0.01, float(state.reserve), hint="Part of the torque limits kept for feedback"
        )
        calm = gui.add_number(
            "calm", float(state.calm), min=0.0, max=0.5, step=1e-3, hint="Part of the time given for calm joints"
        )
        self._limits: dict[str, Any] = {"payload": payload, "reserve": reserve, "calm": calm}
        if session.setup.presets:
            self._limits["preset"] = gui.add_dropdown(
                "preset", (_NONE, *session.setup.presets), initial_value=state.preset or _NONE,
                hint="Conditions of the robot's controller",
            )  # fmt: skip
        self._limits["self_collision"] = gui.add_checkbox(
            "self-collision", state.self_collision, hint="Links keep clear of each other, too"
        )
        for name, handle in self._limits.items():
            self._on_update(handle, partial(self._change_limit, name))

    def _note(self, key: str, action: Callable[[], object]) -> Callable[[Any], Any]:
        """A callback that notes an action for the next frame; of one key the last note counts."""

        async def noted(_: Any) -> None:
            self._notes[key] = action

        return noted

    def _on_update(self, handle: Any, action: Callable[[Any], object]) -> None:
        """Call a function with the value that a browser gives to a widget, in the next frame."""

        async def noted(event: Any) -> None:
            if event.client is not None:  # else this page itself changed the widget
                self._known[_key(handle)] = handle.value
                self._notes[_key(handle)] = partial(action, handle.value)

        handle.on_update(noted)

    def _write(self, handle: Any, value: object) -> None:
        """Show a value in a widget, unless a browser has just given it another one, noted already or to be noted."""
        key = _key(handle)
        if key not in self._notes and handle.value == self._known.get(key, handle.value):
            handle.value = value
            self._known[key] = handle.value

    def _watch_gizmo(self, key: str, gizmo: Any, action: Callable[[], None]) -> None:
        """Call a function in the next frame after a browser has moved a gizmo, which is held until it is released."""

        async def dragged(event: Any) -> None:
            self._held[key] = 0.0 if event.phase == "end" else time.monotonic()
            self._notes[f"gizmo {key}"] = action

        gizmo.on_update(dragged)

    # Requests of browsers, done in the main thread.

    def _toggle(self) -> None:
        self._playing = not self._playing
        self._play_button.label = "Pause" if self._playing else "Play"

    def _seek(self, time: float) -> None:
        self._time = time
        if self._playing:
            self._toggle()
        self._drawn.pop("time", None)

    def _drag_end(self, end: End) -> None:
        self._session.drag(end, _pose_of(self.view.gizmos[end]))

    def _drag_obstacle(self) -> None:
        if (found := self._chosen()) is not None:
            self._session.replace_obstacle(found, moved(found, _pose_of(self.view.mover)))

    def _add_obstacle(self) -> None:
        middle = (self._session.pose_of("start").translation + self._session.pose_of("goal").translation) / 2
        made = new_obstacle(self._kind.value, middle, self._session.state.obstacles)
        self._selected = made.name
        self._session.change(obstacles=(*self._session.state.obstacles, made))

    def _turn(self, end: End, joint: int, position: float) -> None:
        q = list(getattr(self._session.state, end))
        q[joint] = position
        self._session.change(**{end: q})

    def _select(self, name: str) -> None:
        self._selected = name

    def _shift(self, position: tuple[float, float, float]) -> None:
        if (found := self._chosen()) is not None and (at := placement_of(found)) is not None:
            self._session.replace_obstacle(found, moved(found, pin.SE3(at.rotation, np.array(position))))

    def _resize(self, which: int, size: float) -> None:
        if (found := self._chosen()) is not None and (sizes := sizes_of(found)) is not None:
            changed = [size if k == which else one for k, one in enumerate(sizes)]
            self._session.replace_obstacle(found, resized(found, changed))

    def _remove_obstacle(self) -> None:
        if (found := self._chosen()) is not None:
            self._session.replace_obstacle(found, None)

    def _change_limit(self, name: str, value: Any) -> None:
        self._session.change(**{name: "" if name == "preset" and value == _NONE else value})

    def _save(self, save: Callable[[], Path], event: Any) -> None:
        """Save in the callback's own thread: a report takes a second."""
        try:
            words = f"Saved: {save()}"
        except (ArmdynError, OSError) as error:
            words = f"Not saved: {error}"
        self._notes["saved"] = lambda: setattr(self._saved, "content", note_html(words))

    def _chosen(self) -> Obstacle | None:
        """The selected obstacle; None: no selection."""
        return next((one for one in self._session.state.obstacles if one.name == self._selected), None)

    # Drawing.

    def _changed(self, what: str, now: object) -> bool:
        """Whether the state differs from the drawn one."""
        if what in self._drawn and self._drawn[what] == now:
            return False
        self._drawn[what] = now
        return True

    def _show_state(self) -> None:
        session, state, view = self._session, self._session.state, self.view
        for end in END_NAMES:
            held = time.monotonic() - self._held.get(end, 0.0) < _LET_GO
            if not held and self._changed(f"gizmo {end}", (getattr(state, end), self._held.get(end))):
                view.place_gizmo(end)
            for slider, q in zip(self._sliders[end], getattr(state, end), strict=True):
                if abs(slider.value - q) > _STEP / 2:  # a rounded number sent back would undo the browser's next key
                    self._write(slider, _fitting(q, slider.min, slider.max))
        if self._changed("ends", (state.start, state.goal, session.touching, id(session.solution))):
            view.show_ends(session.solution.trajectory if session.solution else None)
        if self._changed("payload", state.payload):
            view.show_payload()
        for name, handle in self._limits.items():
            self._write(handle, getattr(state, name) or (_NONE if name == "preset" else getattr(state, name)))
        if self._changed("obstacles", (state.obstacles, self._selected)):
            self._show_obstacles()
        self._show_chosen()
        if self._changed("answer", content := answer_html(session)):
            self._answer.content = content

    def _show_obstacles(self) -> None:
        self.view.show_obstacles()
        names = [one.name for one in self._session.state.obstacles]
        if self._selected not in names:
            self._selected = None
        self._choice.options = (_NONE, *names)
        self._choice.value = self._selected or _NONE
        if time.monotonic() - self._held.get("mover", 0.0) >= _LET_GO:
            self.view.show_mover(self._chosen())

    def _show_chosen(self) -> None:
        """The numbers of the selected obstacle."""
        one = self._chosen()
        at, sizes = (None, None) if one is None else (placement_of(one), sizes_of(one))
        self._position.visible, self._remove.visible = at is not None, one is not None
        if at is not None:
            self._write(self._position, tuple(np.round(at.translation, 3).tolist()))
        labels = SIZES[type(one).__name__.lower()] if sizes else ()
        for handle, label, size in zip_longest(self._sizes, labels, sizes or ()):
            handle.visible = label is not None
            if label is not None:
                handle.label = f"{label} [m]"
                self._write(handle, float(size))

    def _show_motion(self) -> None:
        solution = self._session.solution
        if not self._changed("motion", id(solution)):
            return
        motion = solution.trajectory if solution else None
        self.view.show_path(motion)
        if motion is None:
            return
        self._time = min(self._time, motion.duration)
        self._clock.max = float(motion.duration)
        if self._changed("speed", True):
            speed = playing_speed([motion.duration])
            self._speed.value = min(self._speed.options, key=lambda text: abs(np.log(_speed_of(text) / speed)))

    def _play(self, seconds: float) -> None:
        solution = self._session.solution
        if solution is None:
            if self._changed("time", self._session.state.start):
                self.view.show_arm(np.array(self._session.state.start))
            return
        motion, speed = solution.trajectory, _speed_of(self._speed.value)
        if self._playing:
            self._time += seconds * speed
            if self._time > motion.duration + _REST * speed:
                self._time = 0.0
        at = min(self._time, motion.duration)
        if self._changed("time", (at, id(solution))):
            self.view.show_arm(motion(motion.t[0] + at).q)
        self._frames += 1
        if self._playing and self._frames % _SLIDER_EVERY == 0:
            self._write(self._clock, float(at))

    def _look(self) -> None:
        """Place the camera; where a phone has the widgets in its lower half, the arm is in the upper one."""
        planar, reach = self.view.planar, self.view.reach

        def place(camera: Any, away: float, lower: float) -> None:
            camera.position = tuple(away * reach * x for x in ((0.0, -1.9, 0.2) if planar else (0.85, -0.75, 0.6)))
            camera.look_at = (0.0, 0.0, reach * ((0.0 if planar else 0.22) - lower))

        async def connected(client: Any) -> None:
            if 0 < client.camera.image_width < _PHONE:
                place(client.camera, 1.5, 0.7)

        place(self._server.initial_camera, 1.0, 0.0)
        self._server.on_client_connect(connected)


def _fitting(position: float, lower: float, upper: float) -> float:
    """Round a joint's position [rad or m] to the digits of the field next to its slider, within its limits."""
    return float(np.clip(round(float(position), 3), lower, upper))


def _key(handle: Any) -> str:
    return f"widget {id(handle)}"


def _pose_of(handle: Any) -> pin.SE3:
    w, x, y, z = handle.wxyz
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(handle.position))


def _speed_of(text: str) -> float:
    one, _, part = text.partition("/")
    return float(one) / float(part or 1)


@contextmanager
def _same_origin(host: str) -> Iterator[None]:
    """Context in which websocket servers refuse `foreign` requests: viser has no option for that."""
    plain = websockets.asyncio.server.serve

    def guarded(*given: Any, process_request: Any, **keywords: Any) -> Any:
        def checked(connection: Any, request: Any) -> Any:
            if foreign(host, request.headers.get_all("Host"), request.headers.get_all("Origin")):
                return connection.respond(403, "armdyn studio: open this page by its own address\n")
            return process_request(connection, request)

        return plain(*given, process_request=checked, **keywords)

    websockets.asyncio.server.serve = guarded
    try:
        yield
    finally:
        websockets.asyncio.server.serve = plain
