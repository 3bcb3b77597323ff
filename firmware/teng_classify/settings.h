/* SPDX-License-Identifier: Apache-2.0
 *
 * What differs from board to board. Change it here, or give it to the compiler with -D.
 */
#ifndef TENG_CLASSIFY_SETTINGS_H
#define TENG_CLASSIFY_SETTINGS_H

#if defined(__has_include)
#if !__has_include("taxel_model.h")
#error "no network here: taxel bundle RUN --board mega --output THIS_FOLDER writes taxel_model.h"
#endif
#endif
#include "taxel_model.h"

#ifndef TAXEL_BOARD
#define TAXEL_BOARD 0 /* its number in the hand */
#endif
#ifndef TAXEL_BOARD_ID
#define TAXEL_BOARD_ID TAXEL_TARGET /* at most 32 printable ASCII characters */
#endif

/* The pins of the window's columns, in the order of TAXEL_CHANNEL_NAMES: all sensors on one board.
 * A network trained on four channels (taxel train --window channels=…) takes 1, 4, 7, 10. */
#ifndef TAXEL_CHANNELS
#define TAXEL_CHANNELS 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11
#endif
/* A grounded pin that is read before each sensor and thrown away, so that the converter's capacitor
 * begins from 0 V for each; ground the other free pins too. */
#ifndef TAXEL_GROUND_PIN
#define TAXEL_GROUND_PIN 15
#endif

/* The network knows counts of one reference only. EXTERNAL: the board's 3.3 V on the pin AREF;
 * AVCC: its 5 V, nothing on AREF. */
#define TAXEL_EXTERNAL 0
#define TAXEL_AVCC 1
#ifndef TAXEL_REFERENCE
#define TAXEL_REFERENCE (TAXEL_MODEL_REFERENCE_MV > 4000 ? TAXEL_AVCC : TAXEL_EXTERNAL)
#endif

#ifndef TAXEL_BAUD
#define TAXEL_BAUD 500000UL /* must divide 2,000,000 */
#endif

#endif
