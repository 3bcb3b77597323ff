/* SPDX-License-Identifier: Apache-2.0 */
#include "taxel_window.h"

#include <string.h>

static uint8_t counts_as_row(const uint16_t counts[]) {
  for (uint8_t c = 0; c < TAXEL_COLUMNS; c++)
    if ((int16_t)counts[c] > TAXEL_GATE_COUNTS) return 1;
  return 0;
}

static void note_ends(taxel_window *window, const uint16_t counts[]) {
  for (uint8_t c = 0; c < TAXEL_COLUMNS; c++) {
    if (counts[c] < TAXEL_END_COUNTS) window->at_end[c] = 0;
    else if (window->at_end[c] < 255) window->at_end[c]++;
  }
}

uint8_t taxel_window_push(taxel_window *window, uint32_t tick, const uint16_t counts[]) {
  if (!counts_as_row(counts)) return 0;
  if (tick - window->last_tick > TAXEL_GAP_TICKS) { /* another contact */
    window->rows = 0;
    window->skip = 0;
    memset(window->at_end, 0, sizeof window->at_end);
  }
  window->last_tick = tick;
  if (window->skip) {
    window->skip--;
    return 0;
  }
  note_ends(window, counts);
  taxel_set_row(window->rows++, counts);
  return window->rows == TAXEL_ROWS;
}

void taxel_window_next(taxel_window *window) {
#if TAXEL_STRIDE < TAXEL_ROWS
  memmove(taxel_image[1], taxel_image[1 + TAXEL_STRIDE],
          (TAXEL_ROWS - TAXEL_STRIDE) * sizeof taxel_image[0]);
  window->rows = TAXEL_ROWS - TAXEL_STRIDE;
#else
  window->rows = 0;
  window->skip = TAXEL_STRIDE - TAXEL_ROWS;
  memset(window->at_end, 0, sizeof window->at_end);
#endif
}

uint8_t taxel_doubt(const taxel_window *window, const taxel_answer *answer) {
  for (uint8_t c = 0; c < TAXEL_COLUMNS; c++)
    if (window->at_end[c] >= TAXEL_ROWS) return TAXEL_SATURATED;
  return answer->confidence < TAXEL_LEAST_CONFIDENCE ? TAXEL_NOT_SURE : TAXEL_SURE;
}
