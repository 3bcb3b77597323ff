/* SPDX-License-Identifier: Apache-2.0
 *
 * The hand's registers: a tick of 1 ms in which every current is read, judged and acted on.
 *
 * The chip's own watchdog stands behind it: 60 ms without a whole tick and the chip resets, which
 * leaves every driver's input to its pull-down. It resets at once, without its interrupt first:
 * that would never come, nor the reset after it, where the program hangs with interrupts off.
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
