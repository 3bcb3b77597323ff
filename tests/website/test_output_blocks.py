"""Output blocks: found where they stand, compared as a reader would, stale ones refused."""

import shlex
from collections.abc import Sequence
from pathlib import Path

import pytest
from forked import Forked
from website.output_blocks import WIDTH, blocks, matches, plain, renew, stale

ROOT = Path(__file__).parents[2]
PAGE = """# Title

```sh
taxel models
taxel info a.mcap   # a word to the reader
```

```text
one
two
```

Words.

```sh
taxel find
```

More words.

```text
no command's output
```

<!-- not run -->
```sh
taxel live x
```

<!-- output of: taxel demo --seconds 0 -->
```text
three
```
"""


def test_a_block_belongs_to_the_commands_right_before_it_or_to_the_one_that_is_named():
    first, second = blocks(PAGE)

    assert (first.before, first.shown) == ((), ("taxel models", "taxel info a.mcap"))
    assert first.text == "one\ntwo\n"
    assert (second.before, second.shown) == (("taxel find",), ("taxel demo --seconds 0",))


@pytest.mark.parametrize(("shown", "printed", "learned", "same"), [
    ("12 windows in 3.1 s", "12 windows in 250 µs", False, False),
    ("12 windows in 3.1 s", "12 windows in 4.9 s", False, True),
    ("12 windows", "13 windows", False, False),
    ("12 windows", "13 windows", True, True),
    ("12 windows", "30 windows", True, False),
    ("0.815 accuracy", "0.822 accuracy", True, True),
    ("0.815 accuracy", "0.615 accuracy", True, False),
    ("accuracy 0.815", "exactness 0.815", True, False),
    ("a\n…\nz", "a\nb\nc\nz", False, True),
    ("a\n…\nz", "a\nb\nc", False, False),
    ("a b …", "a b c d", False, True),
    ("a b …", "a c d", False, False),
    ("a 1 …", "a 2 c", False, False),
    ("┃ a   ┃\n━━━━", "┃ a ┃\n━━━━━━━━", False, True),
    ("a\nb", "a", False, False),
    ("a", "a\nb", False, False),
])  # fmt: skip
def test_times_are_masked_learned_figures_may_be_near_and_words_are_exact(
    shown, printed, learned, same
):
    assert matches(shown, printed, learned=learned) is same


def test_a_stale_block_is_found_and_renewed(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```sh\ntaxel --version\n```\n\n```text\n99.99\n```\nrest\n")

    assert "-99.99" in stale(page)[0]
    assert renew(page) == 1
    assert stale(page) == []
    assert page.read_text().endswith("```\nrest\n")


@pytest.mark.slow
@pytest.mark.longest
@pytest.mark.parametrize("page", ["README.md", "docs/tutorial.md"])
def test_every_block_is_what_its_command_prints(page, forked: Forked, request):
    """Renew them with: python -m website.output_blocks --write PAGE."""

    def run(commands: Sequence[str], folder: Path) -> list[str]:
        own = {"COLUMNS": str(WIDTH), "XDG_CACHE_HOME": str(folder / ".cache")}
        printed = []
        for command in commands:
            name, *words = shlex.split(command)
            assert name == "taxel"
            if words == ["demo", "--seconds", "0"]:
                made: Path = request.getfixturevalue("demo_made_once")
                printed.append(plain((made / "printed.txt").read_text("utf-8")))
                continue
            done = forked.run(words, folder, variables=own)
            assert done.code == 0, f"{command}: {done.err}"
            printed.append(plain(done.out))
        return printed

    assert blocks((ROOT / page).read_text("utf-8"))
    assert "\n".join(stale(ROOT / page, run)) == ""
