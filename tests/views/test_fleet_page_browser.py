"""The fleet's page in a real browser: it never passes an old table off as the present."""

import threading

import pytest
from chromium import CHROMIUM, Browser

from taxel.fleet.page import FleetPage

STATE = "(document.getElementById('state')?.textContent ?? '')"
STATION = {"station": "bench-1", "presence": "LIVE", "age_s": 0.2, "state": "STABLE"}


@pytest.mark.slow
def test_a_table_whose_program_stands_still_is_called_old_and_is_followed_again(tmp_path):
    """One that is stopped (Ctrl-Z) takes requests and answers none."""
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    answers = threading.Event()
    answers.set()

    def snapshot():
        answers.wait(30)
        broker = {"connected": True, "why": "", "address": "127.0.0.1:1883"}
        return {"broker": broker, "refused": 0, "beyond": 0, "stations": [STATION]}

    with Browser(tmp_path) as browser, FleetPage(snapshot) as page:
        browser.open(page.url)
        browser.until(f"{STATE}.startsWith('1 station,')")
        answers.clear()
        try:
            browser.until(f"{STATE} === 'taxel fleet does not answer: what is shown is old'")
        finally:
            answers.set()
        browser.until(f"{STATE}.startsWith('1 station,')")


@pytest.mark.slow
def test_a_key_that_could_not_be_handed_over_is_not_lost(tmp_path):
    """As where the program stood still just as the page came: its address must suffice."""
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    broker = {"connected": True, "why": "", "address": "127.0.0.1:1883"}
    fleet = {"broker": broker, "refused": 0, "beyond": 0, "stations": [STATION]}
    no_answer_once = """const ask = fetch; let asked = 0;
        window.fetch = (...all) => (asked++ ? ask(...all) : Promise.reject(Error("no answer")));"""
    with Browser(tmp_path) as browser, FleetPage(lambda: fleet) as page:
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=no_answer_once)
        browser.open(page.url)
        browser.until(f"{STATE}.startsWith('1 station,')")
        assert browser.ask("location.hash") == ""
