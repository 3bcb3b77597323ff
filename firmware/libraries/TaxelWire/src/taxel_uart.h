/* SPDX-License-Identifier: Apache-2.0
 *
 * USART0 of the ATmega2560 with rings of its own: whole frames out or none, nothing waits.
 *
 * It takes the interrupts of the Arduino core's `Serial`, so a sketch uses one or the other.
 * Knows nothing about messages.
 */
#ifndef TAXEL_UART_H
#define TAXEL_UART_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Begin at a rate that 2,000,000 divides by; sends the zero byte that a sender begins with. */
void taxel_uart_begin(uint32_t baud);

/* Frame a payload and queue it; 0 where there is no room for all of it, and nothing is queued.
 * A zero byte goes before it too, so that a delimiter that is damaged costs one frame, not two. */
uint8_t taxel_uart_send(const uint8_t *payload, uint8_t size);

/* The next byte that came, or -1. */
int16_t taxel_uart_read(void);

/* True while bytes that came wait to be read. */
uint8_t taxel_uart_waiting(void);

#ifdef __cplusplus
}
#endif
#endif
