/* SPDX-License-Identifier: Apache-2.0
 *
 * The image network of taxel in 8-bit integers, for the ATmega2560; also builds on a host.
 *
 * Its numbers stand in taxel_model.h (sizes) and taxel_weights.h, which `taxel bundle --board mega`
 * writes. Plain C without malloc. Knows nothing about registers, pins, time or messages.
 * It computes what src/taxel/bundles/avr/integers.py computes, number for number.
 */
#ifndef TAXEL_CNN_H
#define TAXEL_CNN_H

#include <stdint.h>

#include "taxel_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#if TAXEL_SIGNED_INPUT
typedef int8_t taxel_input;
#else
typedef uint8_t taxel_input;
#endif

/* The window, oldest row first, with a border of zeros: rows 1 … TAXEL_ROWS, columns likewise. */
extern taxel_input taxel_image[TAXEL_ROWS + 2][TAXEL_COLUMNS + 2];

typedef struct {
  uint8_t best;       /* the likeliest class; the first of equals */
  uint8_t confidence; /* its probability, 255 for 1 */
} taxel_answer;

/* Write one row of the window from a scan's converter counts; row 0 … TAXEL_ROWS - 1. */
void taxel_set_row(uint8_t row, const uint16_t counts[TAXEL_COLUMNS]);

/* Tell the class of the window that stands in taxel_image, which stays as it is. */
taxel_answer taxel_classify(void);

/* Whether this build gives, for a window stored with it, what Python's integers gave: 1 or 0. Call
 * it at boot, before the first row: it uses taxel_image and leaves it empty. */
uint8_t taxel_self_check(void);

/* The last layer's sums of the last call. */
extern int32_t taxel_logits[TAXEL_CLASSES];

#ifndef __AVR__
/* On a host: sums that left 24 bits since the start; 0 unless the bounds are wrong. */
extern uint32_t taxel_overflows;
#endif

#ifdef __cplusplus
}
#endif
#endif
