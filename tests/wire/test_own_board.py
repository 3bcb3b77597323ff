"""The C code of the how-to sends the golden bytes."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
AROUND = """
#include <stdint.h>
#include <stdio.h>
#include <string.h>
static uint16_t _crc_xmodem_update(uint16_t crc, uint8_t byte) {
  crc ^= (uint16_t)byte << 8;
  for (int i = 0; i < 8; i++) crc = crc & 0x8000 ? (crc << 1) ^ 0x1021 : crc << 1;
  return crc;
}
static void write_byte(uint8_t byte) { printf("%02x", byte); }
static struct { void (*write)(uint8_t); } Serial = { write_byte };
"""
MAIN = """
int main(void) {
  char line[1024];
  while (scanf("%1023s", line) == 1) {
    uint8_t payload[256];
    int size = strlen(line) / 2;
    for (int i = 0; i < size; i++) {
      unsigned value;
      sscanf(line + 2 * i, "%2x", &value);
      payload[i] = value;
    }
    send(payload, size);
    printf("\\n");
  }
  return 0;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_how_tos_c_code_sends_the_golden_frames(tmp_path: Path):
    page = (ROOT / "docs" / "how-to" / "serial-boards.md").read_text()
    (code,) = re.findall(r"^```c\n(.*?)^```", page, re.M | re.S)
    (tmp_path / "send.c").write_text(AROUND + code + MAIN)
    command = ["cc", "-Wall", "-Werror", "-o", str(tmp_path / "send"), str(tmp_path / "send.c")]
    subprocess.run(command, check=True)
    cases = json.loads((ROOT / "protocol" / "vectors.json").read_text())["valid"]
    sent = subprocess.run(
        [str(tmp_path / "send")],
        input="\n".join(case["payload"] for case in cases),
        capture_output=True,
        text=True,
        check=True,
    )
    assert sent.stdout.split() == [case["frame"] for case in cases]
