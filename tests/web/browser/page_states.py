"""States in which a page is checked: `Room`, used through conftest's fixture `helper`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

PAD = """() => { const pad = { id: "Wireless Controller", index: 0, connected: true,
  mapping: "standard", axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
  navigator.getGamepads = () => [pad]; }"""


@dataclass
class Room:
    """One browser page that goes from state to state; each method leaves it in one.

    Attributes:
        lab: the laboratory of page_lab.flying_lab.
        runs: ids of its two runs, for the replay.
    """

    page: Any
    lab: Any
    runs_made: tuple[str, str]

    def enter(self, name: str, password: str) -> None:
        self.page.goto(f"{self.lab.base}/login")
        self.page.fill("input[name=name]", name)
        self.page.fill("input[name=password]", password)
        self.page.click("form.people button")
        self.page.wait_for_selector("#behaviors button", state="attached")

    def _console(self, tab: str) -> None:
        self.lab.experiment = None
        if self.page.url.split("#")[0] != f"{self.lab.base}/":
            self.page.goto(f"{self.lab.base}/")
        self.page.wait_for_selector("#behaviors button", state="attached")
        self.page.keyboard.press("Escape")
        if self.page.locator(".chart.expanded").count():
            self.page.click(".chart.expanded [aria-label=expand]")
        self.page.click(f"[data-tab={tab}]")

    def _go(self, path: str, ready: str) -> None:
        self.page.goto(f"{self.lab.base}{path}")
        self.page.wait_for_selector(ready)

    def fly(self) -> None:
        self._console("fly")

    def guide(self) -> None:
        self._console("fly")
        if self.page.locator("#help-panel[open]").count() == 0:
            self.page.click("#help")
        self.page.wait_for_selector("#help-panel[open]")

    def people(self) -> None:
        self._console("fly")
        self.page.click("#who")
        self.page.wait_for_selector("#users .user >> nth=0")

    def experiments(self) -> None:
        self._console("experiments")
        self.page.wait_for_selector("#experiment .card.open .start")
        self.page.wait_for_selector("#checklist li")

    def gains(self) -> None:
        self._console("gains")
        self.page.fill("#search", "control.position")
        self.page.wait_for_selector(".gain >> visible=true")

    def gains_history(self) -> None:
        self._console("gains")
        self.page.click("#parameter-views button >> nth=0")
        self.page.wait_for_selector(".timeline li .values")

    def tune(self) -> None:
        """Show two step tests, the second better damped."""
        self._console("tune")
        boxes = self.page.locator(".tests input[type=checkbox]")
        for count in (1, 2):
            if boxes.count() < count:
                self.page.wait_for_selector("#tab-tune .act button:enabled >> nth=0")
                self.page.click("#tab-tune .act button >> nth=0")
                boxes.nth(count - 1).wait_for()
                self.lab.vehicle.zeta = 0.7
        for box in boxes.all():
            box.check()

    def calibrate(self) -> None:
        """Show an accelerometer's result, to be accepted."""
        self._console("calibrate")
        found = self.lab.calibrating
        self.lab.experiment = found.ended("accelerometer", found.accelerometer())
        self.page.wait_for_selector(".outcome .found")

    def calibrating(self) -> None:
        """Show the calibration of the accelerometer, with five poses held."""
        self._console("calibrate")
        found = self.lab.calibrating
        live = {**found.pose_figures(5), "poses": (5.0, ""), "condition number": (14.2, "")}
        self.lab.experiment = found.told(
            "accelerometer",
            live,
            step_number=6,
            step_count=12,
            step_share=0.6,
            instruction="Hold the vehicle still for 1 s: nose up by 20°",
        )
        self.page.wait_for_selector(".sphere .held >> nth=4")

    def beacons(self) -> None:
        self._console("beacons")
        self.page.wait_for_selector("#beacons-errors .estimate")

    def link(self) -> None:
        self._console("link")

    def signals(self) -> None:
        self._console("fly")
        self.page.click("#chart-0 button:text-is('Signals')")
        self.page.wait_for_selector(".menu.signals details")

    def charts(self) -> None:
        self._console("fly")
        self.page.click("#chart-0 [aria-label=expand]")
        self.page.wait_for_selector("#chart-0.expanded")

    def pad_editor(self) -> None:
        self._console("fly")
        self.page.evaluate(PAD)
        self.page.click("#sticks button:text-is('Set up pad')")

    def runs(self) -> None:
        self._go("/runs", "#list tr[data-index]")
        self.page.click("#list tr[data-index] >> nth=1")
        self.page.wait_for_selector("#detail h2")

    def replay(self) -> None:
        run, later = self.runs_made
        self._go(f"/replay/{run}?with={later}#t=9", "main[data-shown]")

    def compare(self) -> None:
        run, later = self.runs_made
        self._go(f"/compare?run={run}&run={later}", "#parameters h2")
        self.page.wait_for_selector("#signals .plot canvas >> nth=5")

    def design(self) -> None:
        self._go("/design", "section[data-theme=dark] h2")

    def setup(self) -> None:
        self._go("/setup", "#checks li")
        self.page.wait_for_selector("#volume rect.confirmed >> nth=0")

    def kill(self) -> None:
        self._go("/kill", "#cut")

    def sign_in(self) -> None:
        self.page.context.clear_cookies()
        self._go("/login", "form.people")
