"""A browser driven by its own protocol: pages as a person has them, by mouse, touch and keys."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest
from tornado.websocket import WebSocketClientConnection, websocket_connect

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
MOST = 2**28  # bytes of a message
PATIENCE = 60.0  # s


def command(profile: Path, *words: str) -> list[str]:
    """Command that starts a headless Chromium; skips the test where none is installed."""
    if CHROMIUM is None:
        pytest.skip("no chromium, chromium-browser or google-chrome is installed")
    return [
        *(CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run"),
        *("--disable-background-networking", "--hide-scrollbars", f"--user-data-dir={profile}"),
        *words,
    ]


def printed(page: Path, *options: str, mark: str = "") -> str:
    """What a headless Chromium prints for a page, which it has had for five seconds of its own."""
    fixed = ("--window-size=800,600", "--virtual-time-budget=5000")
    done = subprocess.run(
        command(page.parent / "profile", *fixed, *options, page.as_uri() + mark),
        check=True,
        timeout=120,
        capture_output=True,
        text=True,
    )
    return done.stdout


class Browser:
    """One window of a headless Chromium."""

    def __init__(self, folder: Path) -> None:
        profile = folder / "profile"
        self.process = subprocess.Popen(
            command(profile, "--mute-audio", "--remote-debugging-port=0", "about:blank"),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self.loop = asyncio.new_event_loop()
        self.asked = 0
        self.errors: list[str] = []
        self.events: list[dict[str, Any]] = []
        where = profile / "DevToolsActivePort"
        end = time.monotonic() + PATIENCE
        while not (where.exists() and where.read_text().count("\n") >= 1):
            assert time.monotonic() < end, "the browser does not start"
            time.sleep(0.05)
        port, path = where.read_text().split("\n")[:2]
        self.socket = self.loop.run_until_complete(self._connected(f"ws://127.0.0.1:{port}{path}"))
        target = self.tell("Target.createTarget", session=None, url="about:blank")["targetId"]
        joined = self.tell("Target.attachToTarget", session=None, targetId=target, flatten=True)
        self.session: str = joined["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.tell(f"{domain}.enable")
        self.size(1200, 800)

    async def _connected(self, url: str) -> WebSocketClientConnection:
        return await websocket_connect(url, max_message_size=MOST)

    def tell(self, method: str, session: str | None = "own", **parameters: Any) -> dict[str, Any]:
        """Answer of the browser to a command."""
        self.asked += 1
        message: dict[str, Any] = {"id": self.asked, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = self.session
        return self.loop.run_until_complete(
            asyncio.wait_for(self._answer(message, self.asked), PATIENCE)
        )

    async def _answer(self, message: dict[str, Any], number: int) -> dict[str, Any]:
        await self.socket.write_message(json.dumps(message))
        while True:
            heard = await self._heard()
            if heard.get("id") == number:
                assert "error" not in heard, f"{message['method']}: {heard['error']}"
                return dict(heard["result"])

    async def _heard(self) -> dict[str, Any]:
        text = await self.socket.read_message()
        assert text is not None, "the browser has gone"
        heard: dict[str, Any] = json.loads(text)
        if heard.get("method") == "Runtime.exceptionThrown":
            told = heard["params"]["exceptionDetails"]
            self.errors.append(told.get("exception", {}).get("description") or told["text"])
        elif heard.get("method") == "Log.entryAdded":
            entry = heard["params"]["entry"]
            if entry["level"] == "error":
                self.errors.append(entry["text"])
        return heard

    # -- what a person does ------------------------------------------------------------------------

    def size(self, width: int, height: int, *, phone: bool = False) -> None:
        """Of the window, or of a phone with a screen to be touched."""
        self.tell(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=2 if phone else 1, mobile=phone,
        )  # fmt: skip
        self.tell("Emulation.setTouchEmulationEnabled", enabled=phone)

    def open(self, url: str, ready: str = "globalThis.shown === true") -> None:
        """Go to an address and wait until the page is drawn."""
        self.errors.clear()
        self.tell("Page.navigate", url=url)
        end = time.monotonic() + PATIENCE
        while not self.run(f"location.href !== 'about:blank' && Boolean({ready})"):
            assert time.monotonic() < end, f"the page is never drawn: {self.errors}"
            assert not self.errors, self.errors
            time.sleep(0.02)

    def run(self, script: str) -> Any:
        """Value of an expression, of a promise too."""
        told = self.tell(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    def script(self, body: str) -> Any:
        """What a body of statements returns, which may wait."""
        return self.run(f"(async () => {{ {body} }})()")

    def place(self, selector: str) -> tuple[float, float, float, float]:
        """Left, top, width and height of an element, once it is in view."""
        return tuple(
            self.script(
                f"const e = document.querySelector({json.dumps(selector)});"
                "e.scrollIntoView({block: 'nearest'});"
                "const {left, top, width, height} = e.getBoundingClientRect();"
                "return [left, top, width, height];"
            )
        )

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Press, move or release the mouse."""
        name = {"press": "mousePressed", "move": "mouseMoved", "release": "mouseReleased"}[kind]
        self.tell(
            "Input.dispatchMouseEvent", type=name, x=x, y=y, clickCount=1, button="left",
            buttons=0 if kind == "release" else 1,
        )  # fmt: skip

    def click(self, selector: str, share: tuple[float, float] = (0.5, 0.5)) -> None:
        """Click in an element, at a share of its width and height."""
        left, top, width, height = self.place(selector)
        self.click_at(left + share[0] * width, top + share[1] * height)

    def click_at(self, x: float, y: float) -> None:
        """Click at a point of the window."""
        self.mouse("press", x, y)
        self.mouse("release", x, y)

    def drag(self, begin: tuple[float, float], end: tuple[float, float], steps: int = 4) -> None:
        """Drag from a point of the window to another."""
        self.mouse("press", *begin)
        for k in range(1, steps + 1):
            x, y = (a + (b - a) * k / steps for a, b in zip(begin, end, strict=True))
            self.mouse("move", x, y)
        self.mouse("release", *end)

    def tap(self, selector: str, share: tuple[float, float] = (0.5, 0.5)) -> None:
        """Touch an element."""
        left, top, width, height = self.place(selector)
        self.tap_at(left + share[0] * width, top + share[1] * height)

    def tap_at(self, x: float, y: float) -> None:
        """Touch a point of the window."""
        self.tell("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
        self.tell("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def key(self, name: str, code: int, text: str = "") -> None:
        """Press a key and let it go."""
        known = {"key": name, "code": name, "windowsVirtualKeyCode": code}
        self.tell("Input.dispatchKeyEvent", type="keyDown", text=text, **known)
        self.tell("Input.dispatchKeyEvent", type="keyUp", **known)

    def write(self, text: str) -> None:
        """Type a text."""
        self.tell("Input.insertText", text=text)

    def picture(self, file: Path) -> None:
        """Take a picture of the window."""
        shot = self.tell("Page.captureScreenshot", format="png")
        file.write_bytes(base64.b64decode(shot["data"]))

    # -- end ---------------------------------------------------------------------------------------

    def close(self) -> None:
        """End the browser."""
        try:
            self.tell("Browser.close", session=None)
            self.loop.run_until_complete(self._hung_up())
        finally:
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait(10)
            self.loop.close()

    async def _hung_up(self) -> None:
        self.socket.close()
        await asyncio.sleep(0)

    def __enter__(self) -> Browser:
        """The browser itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End it."""
        self.close()


@contextmanager
def opened(browser: Browser, page: str, folder: Path) -> Iterator[Browser]:
    """A browser at a page, which must not have had an error at the end."""
    file = folder / "page.html"
    file.write_text(page, encoding="utf-8")
    browser.open(file.as_uri())
    yield browser
    browser.run("0")
    assert browser.errors == []
