/* SPDX-License-Identifier: Apache-2.0
 *
 * What differs from board to board. Change it here, or give it to the compiler with -D.
 */
#ifndef TENG_DAQ_SETTINGS_H
#define TENG_DAQ_SETTINGS_H

#ifndef TAXEL_BOARD
#define TAXEL_BOARD 0 /* its number in the hand: 0, 1, 2 */
#endif
#ifndef TAXEL_BOARD_ID
#define TAXEL_BOARD_ID "TENG" /* its name, at most 32 printable ASCII characters */
#endif

/* Which analog pins are sent, in this order. The thesis: A1, A4, A7 and A10 of each of three
 * boards, all others grounded. For 16 sensors on one board:
 * 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15 and TAXEL_GROUND_READS 0. */
#ifndef TAXEL_CHANNELS
#define TAXEL_CHANNELS 1, 4, 7, 10
#endif
/* Read the grounded pin below each sensor first and throw that away: the converter's capacitor
 * then begins from 0 V for each sensor, as where every pin is read in turn. */
#ifndef TAXEL_GROUND_READS
#define TAXEL_GROUND_READS 1
#endif

#ifndef TAXEL_RATE_HZ
#define TAXEL_RATE_HZ 1000 /* scans a second; must divide 1,000,000 */
#endif
#ifndef TAXEL_BAUD
#define TAXEL_BAUD 500000UL /* must divide 2,000,000 */
#endif

/* What the converter compares with. AVCC: the board's 5 V, nothing on the AREF pin. EXTERNAL: what is
 * on the AREF pin, such as the board's own 3.3 V, which the thesis's signals end at; with a
 * voltage on AREF never choose another. 1V1 and 2V56: the chip's own. */
#define TAXEL_EXTERNAL 0
#define TAXEL_AVCC 1
#define TAXEL_1V1 2
#define TAXEL_2V56 3
#ifndef TAXEL_REFERENCE
#define TAXEL_REFERENCE TAXEL_AVCC
#endif
#ifndef TAXEL_REFERENCE_MV
#define TAXEL_REFERENCE_MV 5000 /* its voltage as measured, millivolts; sent to the host */
#endif

/* 128: 125 kHz, ten good bits. 64, 32, 16: faster and less exact; docs/how-to/firmware.md. */
#ifndef TAXEL_ADC_PRESCALER
#define TAXEL_ADC_PRESCALER 128
#endif

#endif
