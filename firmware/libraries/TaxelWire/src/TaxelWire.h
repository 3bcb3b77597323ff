/* SPDX-License-Identifier: Apache-2.0
 *
 * What a sketch includes: frames, messages and the UART, for C and C++ alike.
 */
#ifndef TAXEL_WIRE_ALL_H
#define TAXEL_WIRE_ALL_H

#include "taxel_frame.h"
#include "taxel_message.h"
#ifdef __AVR__
#include "taxel_board.h"
#include "taxel_uart.h"
#endif

#endif
