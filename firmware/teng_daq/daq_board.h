/* SPDX-License-Identifier: Apache-2.0
 *
 * A sensor board's registers: timer 1 begins a scan, the converter's interrupt goes on with it,
 * the main loop sends it. Knows nothing about what the values mean.
 */
#ifndef DAQ_BOARD_H
#define DAQ_BOARD_H

#ifdef __cplusplus
extern "C" {
#endif

void daq_begin(void);
void daq_run(void); /* once round the main loop */

#ifdef __cplusplus
}
#endif
#endif
