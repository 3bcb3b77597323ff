/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Runs windows_avr on an emulated ATmega2560 and counts its clocks.
 *
 *     run_windows PROGRAM.elf CELLS CLASSES < counts > answers
 *
 * counts: for each window CELLS unsigned 16-bit numbers; answers: a line a window,
 * "best confidence clocks stack logit…". stack is the most bytes that the stack has taken so far,
 * from the clocks' start to their end. Numbers are little-endian.
 *
 * This program links libsimavr, which is under the GPL; it is a program of its own, and no part of
 * taxel links it or is linked by it.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim_avr.h"
#include "sim_elf.h"

enum { WAITING = 1, GIVEN = 2, BEGUN = 3, DONE = 4 };
enum { GPIOR0_AT = 0x3E, GPIOR1_AT = 0x4A, GPIOR2_AT = 0x4B, PAINT = 0xC5 };

static avr_t *avr;

/* Run until the program says this. */
static void until(uint8_t state) {
  while (avr->data[GPIOR0_AT] != state) {
    int now = avr_run(avr);
    if (now == cpu_Done || now == cpu_Crashed) {
      fprintf(stderr, "run_windows: the program crashed at %#x\n", (unsigned)avr->pc);
      exit(1);
    }
  }
}

static uint16_t stack_now(void) { return avr->data[R_SPL] | avr->data[R_SPH] << 8; }

int main(int argc, char **argv) {
  elf_firmware_t program;
  memset(&program, 0, sizeof program);
  if (argc != 4 || elf_read_firmware(argv[1], &program)) {
    fprintf(stderr, "run_windows: needs PROGRAM.elf CELLS CLASSES\n");
    return 2;
  }
  size_t size = 2 * strtoul(argv[2], NULL, 10);
  unsigned classes = (unsigned)strtoul(argv[3], NULL, 10);
  avr = avr_make_mcu_by_name("atmega2560");
  if (!avr || !size || !classes) return 2;
  avr_init(avr);
  avr->frequency = 16000000;
  avr_load_firmware(avr, &program);
  uint8_t counts[size];
  uint16_t deepest = 0;
  while (fread(counts, 1, size, stdin) == size) {
    until(WAITING);
    uint16_t place = avr->data[GPIOR1_AT] | avr->data[GPIOR2_AT] << 8;
    memcpy(avr->data + place, counts, size);
    avr->data[GPIOR0_AT] = GIVEN;
    until(BEGUN);
    /* Free memory below the stack is painted; what has another colour later was used. */
    uint16_t top = stack_now(), bottom = (uint16_t)(top - 2048);
    memset(avr->data + bottom, PAINT, (size_t)(top - bottom + 1));
    avr_cycle_count_t begun = avr->cycle;
    until(DONE);
    unsigned long clocks = (unsigned long)(avr->cycle - begun);
    uint16_t used = 0;
    for (uint16_t at = bottom; at <= top && !used; at++)
      if (avr->data[at] != PAINT) used = (uint16_t)(top - at + 1);
    if (used > deepest) deepest = used;
    until(WAITING);
    const uint8_t *answer = avr->data + place + size;
    printf("%u %u %lu %u", answer[0], answer[1], clocks, deepest);
    for (unsigned k = 0; k < classes; k++) {
      const uint8_t *b = answer + 2 + 4 * k;
      printf(" %ld", (long)(int32_t)(b[0] | b[1] << 8 | b[2] << 16 | (uint32_t)b[3] << 24));
    }
    printf("\n");
  }
  return 0;
}
