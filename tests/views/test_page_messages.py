"""What a page may say: seven commands, and nothing else gets through."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.views.page.messages import (
    LARGEST_BYTES,
    Acknowledge,
    Disarm,
    Pause,
    Play,
    Record,
    RefusedMessage,
    Seek,
    Seen,
    check_labels,
    read_command,
)

ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner),
    max_leaves=12,
)
FUZZ = settings(settings.get_profile("fuzz"))
NAMES = st.sampled_from(
    ["seen", "acknowledge", "record", "seek", "play", "pause", "arm", "disarm", ""]
)
FIELDS = st.sampled_from(["do", "number", "on", "labels", "time_s", "speed", "force_n"])


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ('{"do":"seen","number":7}', Seen(7)),
        ('{"do":"acknowledge"}', Acknowledge()),
        ('{"do":"disarm"}', Disarm()),
        (
            '{"do":"record","on":true,"labels":{"object":"cup 3"}}',
            Record(True, {"object": "cup 3"}),
        ),
        ('{"do":"seek","time_s":-1.5}', Seek(-1.5)),
        ('{"do":"play","speed":2}', Play(2.0)),
        ('{"do":"pause"}', Pause()),
    ],
)
def test_each_command_is_read_as_it_is_written(text, command):
    assert read_command(text) == command


@pytest.mark.parametrize(
    "text",
    [
        '{"do":"arm"}',
        '{"do":"disarm","force_n":0}',
        '{"do":"record","on":1,"labels":{}}',
        '{"do":"record","on":true}',
        '{"do":"record","on":true,"labels":{},"force_n":90}',
        '{"do":"record","on":true,"labels":{"../x":"y"}}',
        '{"do":"record","on":true,"labels":{"object":"a\\u0000b"}}',
        '{"do":"record","on":true,"labels":{"object":"a\\u202eb"}}',
        '{"do":"record","on":true,"labels":{"object":" cup"}}',
        '{"do":"record","on":false,"on":true,"labels":{}}',
        '{"do":"seek","time_s":NaN}',
        '{"do":"seek","time_s":1e999}',
        '{"do":"seek","time_s":true}',
        '{"do":"play","speed":0}',
        '{"do":"seen","number":1.0}',
        '{"do":"seen","number":' + "9" * 4000 + "}",
        "[" * 4000,
        " " * LARGEST_BYTES + "{}",
        '{"do":["acknowledge"]}',
        "",
    ],
)
def test_what_is_almost_a_command_is_refused(text):
    with pytest.raises(RefusedMessage):
        read_command(text)


def test_bytes_are_never_a_command():
    with pytest.raises(RefusedMessage):
        read_command(b'{"do":"acknowledge"}')


def test_a_label_is_counted_in_bytes_of_the_message_not_in_characters():
    """Four thousand characters of three bytes each are more than 4 kB."""
    with pytest.raises(RefusedMessage, match="4096 bytes"):
        read_command('{"do":"acknowledge","x":"' + "€" * 2000 + '"}')


@pytest.mark.data
@FUZZ
@given(st.text(max_size=200) | st.binary(max_size=200) | ANY_JSON.map(json.dumps))
def test_any_text_is_a_command_or_is_refused(message):
    _read_or_refuse(message)


@pytest.mark.data
@FUZZ
@given(st.dictionaries(FIELDS, ANY_JSON, max_size=4), NAMES)
def test_any_fields_under_a_command_s_name_are_checked(fields, name):
    _read_or_refuse(json.dumps({**fields, "do": name}))


@pytest.mark.data
@FUZZ
@given(st.dictionaries(st.text(max_size=40), st.text(max_size=80) | st.integers(), max_size=20))
def test_labels_that_pass_are_short_printable_and_plainly_named(labels):
    try:
        passed = check_labels(labels)
    except RefusedMessage:
        return
    assert passed == labels
    assert len(passed) <= 16
    for name, value in passed.items():
        assert name.isascii()
        assert name.islower()
        assert 1 <= len(value) <= 64
        assert value.isprintable()


def _read_or_refuse(message):
    """Whatever is accepted is one of the seven, with values within their limits."""
    try:
        command = read_command(message)
    except RefusedMessage:
        return
    match command:
        case Seen(number):
            assert 0 <= number < 2**53
        case Record(on, labels):
            assert isinstance(on, bool)
            assert check_labels(labels) == labels
        case Seek(time_s):
            assert abs(time_s) <= 1e12
        case Play(speed):
            assert 1 / 64 <= speed <= 64
        case _:
            assert command in (Acknowledge(), Disarm(), Pause())
