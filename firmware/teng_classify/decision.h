/* SPDX-License-Identifier: Apache-2.0
 *
 * The message that says what a window was classified as: type 7 of the wire.
 *
 *     type u8 = 7, board u8, seq u32, t_us u32, class u8, confidence u8, reason u8, took_us u32
 *
 * seq and t_us are the tick and the time of the window's last row. class: its number, 255 where
 * none is given; confidence: of the likeliest class, 255 for 1; reason: 0 none, 1 a channel at the
 * converter's end, 2 not sure; took_us: how long the network took. Plain C. Knows no registers.
 */
#ifndef TENG_CLASSIFY_DECISION_H
#define TENG_CLASSIFY_DECISION_H

#include "TaxelWire.h"
#include "taxel_window.h"

#define TAXEL_DECISION 7
#define TAXEL_DECISIONS 8 /* the hello's ability of a board that sends them */
#define TAXEL_NO_CLASS 255
#define TAXEL_DECISION_SIZE 17 /* bytes */

/* Write a decision into a payload; returns its length. */
uint8_t taxel_pack_decision(uint8_t *payload, const taxel_head *head, const taxel_answer *answer,
                            uint8_t reason, uint32_t took_us);

#endif
