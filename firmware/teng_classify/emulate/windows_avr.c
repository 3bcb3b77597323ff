/* SPDX-License-Identifier: Apache-2.0
 *
 * The network alone on an ATmega2560, for run_windows: no pins, no clock, no messages.
 *
 * It speaks with the emulator through registers that the chip keeps free for programs: GPIOR0 says
 * whose turn it is, GPIOR1 and GPIOR2 say where the window's counts and its answer stand.
 */
#include <avr/io.h>

#include "taxel_cnn.h"

enum { WAITING = 1, GIVEN = 2, BEGUN = 3, DONE = 4 };

/* Not static: the compiler must not think that it knows what the emulator wrote. */
struct {
  uint16_t counts[TAXEL_ROWS][TAXEL_COLUMNS];
  taxel_answer answer;
  int32_t logits[TAXEL_CLASSES];
} place;

int main(void) {
  GPIOR1 = (uint8_t)(uint16_t)&place;
  GPIOR2 = (uint8_t)((uint16_t)&place >> 8);
  for (;;) {
    GPIOR0 = WAITING;
    while (GPIOR0 != GIVEN) {
    }
    __asm__ volatile("" ::: "memory");
    for (uint8_t r = 0; r < TAXEL_ROWS; r++) taxel_set_row(r, place.counts[r]);
    GPIOR0 = BEGUN; /* cycles are counted from here */
    place.answer = taxel_classify();
    GPIOR0 = DONE;
    for (uint8_t k = 0; k < TAXEL_CLASSES; k++) place.logits[k] = taxel_logits[k];
    __asm__ volatile("" ::: "memory");
  }
}
