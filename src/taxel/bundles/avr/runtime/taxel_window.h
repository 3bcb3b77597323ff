/* SPDX-License-Identifier: Apache-2.0
 *
 * From scans to windows, as taxel.windows.windower does it: rows above the gate count, a gap
 * begins anew. Plain C. Knows nothing about pins or clocks: ticks of the grid are numbered.
 */
#ifndef TAXEL_WINDOW_H
#define TAXEL_WINDOW_H

#include <stdint.h>

#include "taxel_cnn.h"

#ifdef __cplusplus
extern "C" {
#endif

enum taxel_reason { TAXEL_SURE = 0, TAXEL_SATURATED = 1, TAXEL_NOT_SURE = 2 };

/* All zero is its first state. */
typedef struct {
  uint32_t last_tick;             /* of the last row that counted */
  uint16_t skip;                  /* rows still to pass over */
  uint8_t rows;                   /* rows that stand in taxel_image */
  uint8_t at_end[TAXEL_COLUMNS];  /* rows in a row at the converter's end, a channel */
} taxel_window;

/* Take in the scan of a tick. Returns 1 where it completes a window: then classify, and call
 * taxel_window_next before the next scan. */
uint8_t taxel_window_push(taxel_window *window, uint32_t tick, const uint16_t counts[]);

/* Keep the rows that the next window shares with this one. */
void taxel_window_next(taxel_window *window);

/* Why the complete window's answer is not to be given; TAXEL_SURE where it is. */
uint8_t taxel_doubt(const taxel_window *window, const taxel_answer *answer);

#ifdef __cplusplus
}
#endif
#endif
