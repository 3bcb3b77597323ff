/* SPDX-License-Identifier: Apache-2.0
 *
 * The hand's registers: a tick of 1 ms in which every current is read, judged and acted on.
 *
 * The chip's own watchdog stands behind it: 60 ms without a whole tick and its interrupt switches the
 * motors off, 60 more and the chip resets, which leaves every driver's input to its pull-down.
 */
#ifndef HAND_BOARD_H
#define HAND_BOARD_H

#ifdef __cplusplus
extern "C" {
#endif

void hand_begin_board(void);
void hand_run_board(void); /* once round the main loop */

#ifdef __cplusplus
}
#endif
#endif
