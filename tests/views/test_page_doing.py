"""What to do, on the page: never an old word, large enough for two metres, said aloud if wished."""

import time

import pytest
from chromium import WORD
from page_station import SimStation

from taxel.views.page.plan_link import PlanLink
from taxel.views.page.server import serve_page

DO = "document.getElementById('doword')?.textContent"
MM_PER_PX = 286 / 1280
"""Of a 13-inch screen that shows 1280 pixels across."""
CAPITAL = 0.72
"""Height of a capital over its font's size."""
LEAST_MM = 11.6
"""20 minutes of arc at two metres, which ISO 9241-303 recommends."""


class Advising(SimStation):
    """A station that says what to do, and hears what was done."""

    def __init__(self) -> None:
        super().__init__(None, None)
        self.do: dict[str, object] | None = {"word": "HOLD", "why": "the grasp is stable"}
        self.cameras, self.reaction_time_s = "", None

    def snapshot(self):
        trial = {"number": 3, "alarm_s": None, "reaction": "", "outcome": "",
                 "reaction_time_s": self.reaction_time_s, "cameras": self.cameras}  # fmt: skip
        return super().snapshot() | {"do": self.do, "trial": trial}

    def react(self, what: str) -> str:
        self.commands.append(what)
        return ""


@pytest.fixture
def station():
    made = Advising()
    yield made
    made.close()


@pytest.fixture
def opened(browser, station):
    browser.complaints.clear()
    with serve_page(station) as server:
        browser.open(server.url)
        browser.until(f"{DO} === 'HOLD'")
        yield server
        browser.open("about:blank")
    assert browser.complaints == []


def test_what_to_do_is_shown_and_never_an_old_word(browser, opened, station):
    station.do = {"word": "PUT DOWN", "why": "the grasp slips"}
    browser.until(f"{DO} === 'PUT DOWN'")
    assert browser.ask("document.getElementById('dofield').dataset.tone") == "danger"

    station.frozen_s = time.monotonic()
    browser.until(f"{DO} === 'STALE'", within_s=3)
    assert browser.ask("document.getElementById('dofield').dataset.tone") == "lost"


@pytest.mark.parametrize("size", [(1280, 720), (800, 600)])
def test_the_words_can_be_read_from_two_metres(browser, opened, station, size):
    browser.size(*size)
    browser.key("w", "w")
    try:
        for word in ("HOLD STILL", "GRIP HARDER", "PUT DOWN"):
            station.do = {"word": word, "why": "the grasp begins to slip"}
            browser.until(f"{DO} === '{word}'")
            look = "getComputedStyle(document.getElementById('doword')).fontSize"
            pixels = float(str(browser.ask(look)).removesuffix("px"))
            inside = browser.ask(
                "(() => { const word = document.getElementById('doword').getBoundingClientRect();"
                " const box = document.getElementById('dofield').getBoundingClientRect();"
                " return word.left >= box.left && word.right <= box.right && word.top >= box.top"
                " && word.bottom <= box.bottom && box.bottom <= innerHeight; })()"
            )
            assert pixels * CAPITAL * MM_PER_PX >= LEAST_MM
            assert inside, word
    finally:
        browser.key("w", "w")
        browser.size(1280, 720)


def test_on_a_phone_the_reason_is_read_to_its_end(browser, opened, station):
    """It stood beside the word, and ended after three letters."""
    browser.size(390, 844)
    try:
        station.do = {"word": "PUT DOWN", "why": "the grasp slips: stop, and put it down"}
        browser.until(f"{DO} === 'PUT DOWN'")
        whole = """(() => { const why = document.getElementById('dowhy');
            const box = why.getBoundingClientRect();
            const field = document.getElementById('dofield').getBoundingClientRect();
            return why.scrollHeight <= why.clientHeight + 1 && box.right <= field.right
                && box.bottom <= field.bottom; })()"""
        browser.until(whole)
    finally:
        browser.size(1280, 720)


def test_keys_and_buttons_log_what_the_person_did(browser, opened, station):
    browser.until("!document.getElementById('person').hidden")
    for key in "spghlx":
        browser.key(key, key)
    browser.ask("document.querySelector('#outcomes [data-what=held]').click()")
    browser.until("true")
    expected = ["pour stopped", "put down", "grip changed", "held", "slipped", "dropped", "held"]
    until_s = time.monotonic() + 5
    while station.commands != expected:
        assert time.monotonic() < until_s, station.commands
        time.sleep(0.02)


def test_of_several_grasps_the_page_names_the_one_that_the_buttons_are_about(
    browser, opened, station
):
    note = "document.getElementById('trialnote').textContent"
    browser.until(f"{note} === 'grasp 3'")
    station.cameras = "left-2 + right-2"
    browser.until(f"{note} === 'grasp 3, left-2 + right-2'")
    station.reaction_time_s = 0.52
    browser.until(f"{note} === '0.5 s after alarm, left-2 + right-2'")


VOICES = """
window.spoken = [];
window.SpeechSynthesisUtterance = class { constructor(text) { this.text = text; } };
const made = { getVoices: () => %s, speak: (one) => spoken.push(one.text), cancel: () => {} };
Object.defineProperty(window, 'speechSynthesis', { value: made, configurable: true });
true;
"""
OWN, REMOTE = "{ localService: true, lang: 'en-GB' }", "{ localService: false, lang: 'en-US' }"


def test_the_voice_is_off_until_asked_for_and_then_says_each_new_word(browser, opened, station):
    browser.ask(VOICES % f"[{REMOTE}, {OWN}]")
    station.do = {"word": "GRIP HARDER", "why": ""}
    browser.until(f"{DO} === 'GRIP HARDER'")
    assert browser.ask("spoken.length") == 0

    browser.key("v", "v")
    browser.until("spoken.includes('grip harder')")
    station.do = {"word": "PUT DOWN", "why": ""}
    browser.until("spoken.includes('put down')")
    browser.key("v", "v")
    station.do = {"word": "HOLD", "why": ""}
    browser.until(f"{DO} === 'HOLD'")
    assert not browser.ask("spoken.includes('hold')")


def test_a_voice_of_the_network_is_never_used(browser, opened, station):
    browser.ask(VOICES % f"[{REMOTE}]")
    browser.key("v", "v")
    browser.until("document.getElementById('voice').textContent.startsWith('No voice')")
    assert browser.ask("spoken.length") == 0
    browser.key("v", "v")


def test_the_next_trial_of_a_plan_is_shown_and_a_person_says_ready(browser):
    board = PlanLink(60, asks=True)
    board.show("GET READY", waits=True, number=7, words="cup 02, position middle", done=6)
    with serve_page(board) as server:
        browser.open(server.url)
        browser.until(f"{WORD} === 'TRIAL 7 OF 60' && {DO} === 'GET READY'")
        assert browser.ask("document.getElementById('reason').textContent") == (
            "cup 02, position middle"
        )
        assert board.next_step() == ""
        browser.key("Enter", "\r")
        until_s = time.monotonic() + 5
        while (step := board.next_step()) == "":
            assert time.monotonic() < until_s
            time.sleep(0.02)
        assert step == "ready"
        board.show("POUR NOW", "settled: pour now")
        browser.until(f"{DO} === 'POUR NOW'")
        browser.until("document.getElementById('plansteps').hidden")  # drawn with the next frame
        browser.open("about:blank")
