/* SPDX-License-Identifier: Apache-2.0
 *
 * A sensor board of the TENG hand, for the Arduino Mega 2560. Settings: settings.h.
 * What it does: daq_logic.h (plain C) and daq_board.h (registers). How to: docs/how-to/firmware.md.
 */
#include <TaxelWire.h>

#include "daq_board.h"

void setup() { daq_begin(); }

void loop() { daq_run(); }
