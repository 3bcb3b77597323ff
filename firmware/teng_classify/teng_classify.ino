/* SPDX-License-Identifier: Apache-2.0
 *
 * Predicts what is in the TENG hand on the board itself, for the Arduino Mega 2560, and sends decisions
 * only. Settings: settings.h. The network: taxel bundle RUN --board mega --output THIS_FOLDER.
 * How to: docs/how-to/cnn-on-the-board.md.
 */
#include <TaxelWire.h>

#include "classify_board.h"

void setup() { classify_begin(); }

void loop() { classify_run(); }
