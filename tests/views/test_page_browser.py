"""The page in a real browser: states, staleness, keys, sound, sizes, panels."""

import json
import time

import numpy as np
import pytest
from chromium import WORD
from page_station import STATES, SimStation

from taxel.views.page.server import serve_page


@pytest.fixture
def station():
    made = SimStation(None, None)
    made._array = {"name": "own", "channels": ["a", "b"], "unit": "V", "rows": 12}
    yield made
    made.close()


@pytest.fixture
def opened(browser, station):
    """A page on a station without cameras, in its first state."""
    browser.complaints.clear()
    with serve_page(station) as server:
        browser.open(server.url)
        browser.until(f"{WORD} === 'STABLE'")
        yield server
        browser.open("about:blank")
    assert browser.complaints == []


def hidden(panel: str) -> str:
    return f"document.getElementById('{panel}').hidden"


def test_the_key_is_taken_out_of_the_address_and_never_into_a_request(browser, opened):
    assert browser.ask("location.href") == opened.origin + "/"
    assert browser.ask("document.cookie") == ""


@pytest.mark.parametrize("state", list(STATES))
def test_each_state_differs_in_word_sign_and_pattern_not_in_colour_alone(
    browser, opened, station, state
):
    station.become(state)

    browser.until(f"{WORD} === '{state}'")
    look = "getComputedStyle(document.getElementById('state'))"
    sign = {"NO GRASP": "IDLE"}.get(state, state)
    assert browser.ask("document.getElementById('symbol').getAttribute('href')") == f"#sym-{sign}"
    has_pattern = browser.ask(f"{look}.backgroundImage !== 'none' || {look}.borderStyle !== 'solid'"
                              f" || {look}.borderColor !== {look}.backgroundColor")  # fmt: skip
    assert has_pattern == (state != "STABLE")
    assert browser.ask("document.getElementById('spoken').textContent").startswith(state)


@pytest.mark.parametrize(
    ("answers", "word"),
    [
        ([{"target": "shape", "label": "sphere"}], "SPHERE"),
        ([{"target": "shape", "label": "UNKNOWN"}], "UNKNOWN"),
        ([], "NO ANSWER YET"),
        ([{"target": "shape", "label": "", "reason": "nothing above the gate"}], "NO ANSWER YET"),
    ],
)
def test_where_no_monitor_runs_the_large_word_is_the_first_answer(browser, opened, answers, word):
    snapshot = json.dumps({"state": "NONE", "answers": answers})
    shown = f"""import("/static/state.js").then((state) => {{
        const fresh = Object.assign(new state.Freshness(), {{ connected: true, movedMs: 0 }});
        return [state.shown(fresh, {snapshot}, 1).word, state.evidence({snapshot}).name];
    }})"""
    assert browser.ask(shown) == [word, "Events"]


def test_it_says_what_a_first_answer_waits_for_and_how_old_an_answer_is(browser, opened):
    snapshot = json.dumps(
        {
            "state": "NONE",
            "answers": [
                {"target": "shape", "label": "", "reason": "nothing above the gate of 1.55 V yet"}
            ],
        }
    )
    shown = f"""import("/static/state.js").then((state) => {{
        const fresh = Object.assign(new state.Freshness(), {{ connected: true, movedMs: 0 }});
        const ages = [10.9, 13.2, 75].map((now) => state.ageWords({{ time_s: 10 }}, now));
        return [state.shown(fresh, {snapshot}, 1).reason, ...ages, state.ageWords({{}}, 5)];
    }})"""
    assert browser.ask(shown) == [
        "shape; nothing above the gate of 1.55 V yet",
        "",
        "3 s ago",
        "1:05 min ago",
        "",
    ]


def test_values_that_stopped_coming_are_not_shown_as_the_present(browser, opened, station):
    """A board's process hung: the hand went on to show its last touch under "Hand now"."""
    note = "document.getElementById('touchnote').textContent"
    browser.until(f"{note} === 'NO VALUES YET'")
    came = station._scans
    came.append((time.monotonic(), np.full(2, 1.0)))
    browser.until(f"{note} === ''")
    browser.until(f"/^NO NEW VALUES FOR [0-9.]+ s$/.test({note})", within_s=3)
    assert browser.ask("document.getElementById('touch').className") == "row silent"


def test_an_alarm_is_said_once_to_a_screen_reader_and_pictures_have_names(browser, opened, station):
    station.become("WARNING")
    heard = "document.getElementById('heard').textContent"
    browser.until(f"{heard} === 'Warning: the grasp may be slipping: look at the cup'")
    named = "[...document.querySelectorAll('canvas[role=img]')].every(c => c.ariaLabel)"
    assert browser.ask(named)
    browser.ask("document.getElementById('heard').textContent = ''")
    browser.until("!document.querySelector('#alarmlist .note').textContent.startsWith('0.')")
    assert browser.ask(heard) == ""
    station.acknowledge()
    browser.until("document.getElementById('acknowledge').disabled")


def test_the_newest_of_many_alarms_and_the_button_stay_in_sight(browser, opened, station):
    """A list that was centred in its field could not be scrolled to its first line."""
    now = time.monotonic()
    station.alarms = [
        {"key": i, "kind": f"k{i}", "text": f"alarm {i}: " + "a reason of some length " * 3,
         "level": "danger", "since_s": now, "acknowledged": False} for i in range(8)
    ]  # fmt: skip
    browser.until("document.querySelectorAll('#alarmlist li').length === 8")
    inside = """(() => { const box = (id) => document.querySelector(id).getBoundingClientRect();
        const field = box('#alarms'), first = box('#alarmlist li'), button = box('#acknowledge');
        return [first.top >= field.top, button.bottom <= field.bottom]; })()"""
    assert browser.ask(inside) == [True, True]
    station.alarms = []
    browser.until("document.querySelectorAll('#alarmlist li').length === 0")


def test_on_a_phone_no_word_is_cut_off_or_covered(browser, opened, station):
    station.become("UNSTABLE")
    whole = """(() => { const box = (id) => document.querySelector(id).getBoundingClientRect();
        const cut = [...document.querySelectorAll('#alarms, .plot h2, #gripper')]
            .filter((e) => e.clientHeight && (e.scrollWidth > e.clientWidth + 1)).map((e) => e.id);
        const list = box('#alarmlist'), button = box('#acknowledge');
        return [cut, list.bottom <= button.top, document.documentElement.scrollWidth]; })()"""
    try:
        browser.size(390, 844)
        browser.until("document.querySelectorAll('#alarmlist li').length > 0")
        assert browser.ask(whole) == [[], True, 390]
    finally:
        browser.size(1280, 720)


def test_an_unknown_and_a_pause_say_why_and_for_how_long(browser, opened, station):
    for state, reason in (
        ("UNKNOWN", "learning the settled grasp, 0.4 s left"),
        ("NO GRASP", "the grasp has ended: nothing is held"),
    ):
        before, STATES[state] = STATES[state], (reason, None)
        try:
            station.become(state)
            browser.until(f"{WORD} === '{state}'")
            browser.until(f"document.getElementById('reason').textContent === '{reason}'")
            browser.until("/^for 0\\.[2-9] s$/.test(document.getElementById('since').textContent)")
        finally:
            STATES[state] = before


def test_a_score_is_shown_beside_its_threshold_and_never_called_a_probability(
    browser, opened, station
):
    panel = "document.getElementById('probability')"
    browser.until(f"{panel}.innerText.includes('Warning score')")
    words = f"{panel}.querySelector('h2').innerText"
    browser.until(
        f"/0\\.\\d\\d[^]*warns from 0\\.84[^]*slip 0\\.\\d\\d mm, 0\\.\\d mm\\/s/.test({words})"
    )
    assert not browser.ask("/probab/i.test(document.body.innerText)")
    assert browser.ask(f"{panel}.getAttribute('aria-label')") == "Warning score"

    station.scored = False
    browser.until(f"{panel}.innerText.includes('Probability of instability')")
    browser.until(f"/0\\.\\d\\d/.test({words})")
    assert browser.ask(f"{panel}.getAttribute('aria-label')") == "Probability of instability"


def test_a_state_that_is_no_word_of_ours_is_shown_as_unknown(browser, opened, station):
    STATES["FINE"] = ("", 0.1)
    station.state = "FINE"
    try:
        browser.until(f"{WORD} === 'UNKNOWN'")
    finally:
        station.state = "STABLE"
        del STATES["FINE"]


def test_a_station_that_stands_still_is_stale_within_a_second_though_messages_still_come(
    browser, opened, station
):
    """The server lives and pushes on; what it shows no longer moves."""
    station.frozen_s = time.monotonic()
    stood = browser.ask(
        "new Promise(done => { const start = performance.now();"
        " const look = () => { const word = document.getElementById('word').textContent;"
        " if (word === 'STALE') done(performance.now() - start); else setTimeout(look, 10); };"
        " look(); })"
    )

    assert stood < 1000
    assert browser.ask("document.getElementById('board').classList.contains('lost')")
    assert browser.ask("document.title") == "STALE – taxel"
    station.frozen_s = None
    browser.until(f"{WORD} === 'STABLE'")


def test_a_server_that_is_gone_is_no_connection_never_the_last_state(browser, station):
    with serve_page(station) as server:
        browser.open(server.url)
        browser.until(f"{WORD} === 'STABLE'")
    browser.until(f"{WORD} === 'NO CONNECTION'", within_s=3)
    browser.until("document.getElementById('reason').textContent === 'the station has ended'")
    assert browser.ask("getComputedStyle(document.getElementById('probability')).opacity") == "0.32"
    browser.open("about:blank")


def test_without_the_key_the_page_says_what_is_missing(browser, station):
    with serve_page(station) as server:
        browser.call("Network.clearBrowserCookies")
        browser.open(server.origin)
        browser.until("document.getElementById('reason')?.textContent.startsWith('needed the key')")
        assert browser.ask(WORD) == "NO CONNECTION"
        browser.open("about:blank")


@pytest.mark.parametrize("key", ["a", " "])
def test_a_key_acknowledges_and_the_alarm_says_so(browser, opened, station, key):
    station.become("WARNING")
    browser.until("!document.getElementById('acknowledge').disabled")
    browser.key(key, key)

    browser.until("document.getElementById('acknowledge').disabled")
    assert station.commands == ["acknowledge"]
    assert "acknowledged" in str(browser.ask("document.querySelector('#alarmlist').textContent"))


def test_r_records_with_the_labels_that_were_typed_and_r_in_a_field_is_a_letter(
    browser, opened, station
):
    browser.until("!!document.querySelector('#labels input')")
    browser.ask("document.querySelector('#labels input[name=object]').focus()")
    for letter in "ar":
        browser.key(letter, letter)
    browser.key("Escape")
    browser.key("r", "r")
    browser.until("!document.getElementById('recmark').hidden")
    browser.key("r", "r")
    browser.until("document.getElementById('recmark').hidden")

    assert station.commands == [("record", True, {"object": "ar"}), ("record", False, {})]


def test_panels_that_do_not_apply_are_not_shown(browser, opened):
    browser.until(f"!{hidden('sensors')}")
    assert browser.ask(hidden("cameras"))
    assert browser.ask(hidden("replay"))
    assert browser.ask(hidden("handpanel"))  # two channels are no hand
    assert not browser.ask(hidden("probability"))


def test_the_gripper_s_only_control_is_to_disarm_by_button_or_key(browser, opened, station):
    browser.until("!!document.querySelector('#gripper dd')")
    controls = "[...document.querySelectorAll('#gripper :is(button, input, select, a)')]"
    assert browser.ask(f"{controls}.map(c => c.id).join()") == "disarm"
    browser.ask("document.getElementById('disarm').click()")
    browser.until("document.querySelector('#gripper dd.armed') === null")
    station.armed = True
    browser.until("document.querySelector('#gripper dd.armed') !== null")
    browser.key("d", "d")
    browser.until("document.querySelector('#gripper dd.armed') === null")
    assert station.commands == ["disarm", "disarm"]


def test_the_sound_button_says_that_it_waits_then_sounds_then_is_muted(browser, opened):
    text = "document.getElementById('sound').textContent"
    assert str(browser.ask(text)).startswith("Click to enable sound")
    browser.key("x", "x")
    browser.until(f"{text}.startsWith('Sound on')")
    time.sleep(0.75)  # the press that enables sound does not mute it
    browser.key("m", "m")
    browser.until(f"{text}.startsWith('MUTED')")


def test_the_word_fits_its_field_at_every_size(browser, opened, station):
    fits = (
        "(() => { const field = document.querySelector('.words').getBoundingClientRect();"
        " const letters = document.createRange();"
        " letters.selectNodeContents(document.getElementById('word'));"
        " return letters.getBoundingClientRect().right <= field.right; })()"
    )
    try:
        for width, height in ((800, 900), (1280, 720), (1920, 1080), (3840, 2160)):
            browser.size(width, height)
            for state in ("UNKNOWN", "UNSTABLE", "WARNING"):
                station.become(state)
                browser.until(f"{WORD} === '{state}'")
                assert browser.ask(fits), (width, state)
            if width >= 1000:
                assert browser.ask("document.documentElement.scrollHeight <= innerHeight"), width
    finally:
        browser.size(1280, 720)


@pytest.mark.slow
def test_both_simulators_are_seen_images_map_and_traces(browser):
    browser.complaints.clear()
    station = SimStation("sim://cup-pour?duration_s=2", "sim://teng")
    lit = (
        "(() => {{ const c = document.querySelector('{0}'); if (!c) return 0;"
        " const drawn = c.getContext('2d').getImageData(0, 0, c.width, c.height);"
        " return new Set(drawn.data).size; }})()"
    )
    try:
        with serve_page(station) as server:
            browser.open(server.url)
            for canvas in ("#cameras figure:nth-child(2) canvas", "#map", "#hand",
                           "#probability canvas", "#sensors canvas"):  # fmt: skip
                browser.until(f"{lit.format(canvas)} > 8")
            browser.open("about:blank")
    finally:
        station.close()
    assert browser.complaints == []
