/* SPDX-License-Identifier: Apache-2.0
 *
 * A board that predicts what is in the hand: timer 1 begins a scan, the converter's interrupt goes on
 * with it, the main loop fills windows, classifies them and sends decisions. Scans go on while it
 * classifies: they wait in a ring. Knows nothing about what the classes mean.
 */
#ifndef CLASSIFY_BOARD_H
#define CLASSIFY_BOARD_H

#ifdef __cplusplus
extern "C" {
#endif

void classify_begin(void);
void classify_run(void); /* once round the main loop */

#ifdef __cplusplus
}
#endif
#endif
