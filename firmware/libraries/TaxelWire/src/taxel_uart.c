/* SPDX-License-Identifier: Apache-2.0 */
#ifdef __AVR__
#include "taxel_uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "taxel_frame.h"

/* Rings of 256 bytes: an index of one byte wraps by itself, and is read and written at once. */
static volatile uint8_t sent_to, sent_from, came_to, came_from;
static uint8_t sending[256], coming[256];

ISR(USART0_UDRE_vect) {
  uint8_t from = sent_from;
  UDR0 = sending[from++];
  sent_from = from;
  if (from == sent_to) UCSR0B &= (uint8_t)~_BV(UDRIE0);
}

ISR(USART0_RX_vect) {
  uint8_t byte = UDR0;
  uint8_t next = (uint8_t)(came_to + 1);
  if (next == came_from) return; /* full: the frame's check will show it */
  coming[came_to] = byte;
  came_to = next;
}

static void go(void) {
  uint8_t sreg = SREG;
  cli();
  UCSR0B |= _BV(UDRIE0);
  SREG = sreg;
}

void taxel_uart_begin(uint32_t baud) {
  uint16_t divider = (uint16_t)((F_CPU / 8 + baud / 2) / baud - 1);
  UCSR0A = _BV(U2X0);
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00); /* 8 bits, no parity, one stop bit */
  UBRR0H = (uint8_t)(divider >> 8);
  UBRR0L = (uint8_t)divider;
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
  sending[0] = 0;
  sent_to = 1;
  go();
}

uint8_t taxel_uart_send(const uint8_t *payload, uint8_t size) {
  static uint8_t frame[TAXEL_LONGEST_FRAME + 1];
  uint8_t length = taxel_frame(payload, size, frame);
  uint8_t room = (uint8_t)(sent_from - sent_to - 1);
  if (length == 0 || room <= length) return 0;
  uint8_t to = sent_to;
  sending[to++] = 0;
  for (uint8_t i = 0; i < length; i++) sending[to++] = frame[i];
  sent_to = to; /* only now does the interrupt see them */
  go();
  return 1;
}

int16_t taxel_uart_read(void) {
  uint8_t from = came_from;
  if (from == came_to) return -1;
  uint8_t byte = coming[from];
  came_from = (uint8_t)(from + 1);
  return byte;
}

uint8_t taxel_uart_waiting(void) { return came_from != came_to; }
#endif
