/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The serial line: UART 0 on one end, a pseudo-terminal on the other.
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <pty.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "avr_uart.h"
#include "emulated.h"

#define MOST (1 << 20) /* bytes that wait for a reader; then they are dropped and counted */

static void append(queue *to, uint8_t byte) {
  if (to->used == to->room) {
    to->room = to->room ? 2 * to->room : 4096;
    to->bytes = realloc(to->bytes, to->room);
    if (!to->bytes) abort();
  }
  to->bytes[to->used++] = byte;
}

static void drop(queue *from, size_t count) {
  from->used -= count;
  memmove(from->bytes, from->bytes + count, from->used);
}

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq;
  emulated *board = param;
  if (board->tap) fputc((int)(value & 0xFF), board->tap);
  board->sent++;
  if (board->out.used < MOST) append(&board->out, (uint8_t)value);
  else board->refused++;
}

static void feed(emulated *board) {
  size_t done = 0;
  while (board->may_send && done < board->in.used) {
    avr_raise_irq(avr_io_getirq(board->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT),
                  board->in.bytes[done++]);
  }
  if (done) drop(&board->in, done);
}

static void on_room(struct avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq;
  emulated *board = param;
  if (value) board->may_send = 1;
}

static void on_full(struct avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq;
  emulated *board = param;
  if (value) board->may_send = 0;
}

void attach_line(emulated *board, const char *path) {
  avr_t *avr = board->avr;
  uint32_t flags = 0; /* no sleeping, no echo to the console */
  avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
  avr_irq_t *first = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), 0);
  avr_irq_register_notify(first + UART_IRQ_OUTPUT, on_byte, board);
  avr_irq_register_notify(first + UART_IRQ_OUT_XON, on_room, board);
  avr_irq_register_notify(first + UART_IRQ_OUT_XOFF, on_full, board);
  board->port = -1;
  if (!path) return;
  struct termios raw;
  memset(&raw, 0, sizeof raw);
  cfmakeraw(&raw);
  if (openpty(&board->port, &board->terminal, NULL, &raw, NULL)) {
    perror("openpty");
    exit(2);
  }
  fcntl(board->port, F_SETFL, O_NONBLOCK);
  fcntl(board->port, F_SETFD, FD_CLOEXEC);
  unlink(path);
  if (symlink(ttyname(board->terminal), path)) {
    perror(path);
    exit(2);
  }
}

void line_in(emulated *board) {
  uint8_t bytes[4096];
  if (board->port >= 0) {
    ssize_t came = read(board->port, bytes, sizeof bytes);
    for (ssize_t i = 0; i < came; i++) append(&board->in, bytes[i]);
  }
  feed(board);
}

void line_out(emulated *board) {
  if (board->port < 0) {
    board->out.used = 0;
    return;
  }
  while (board->out.used) {
    ssize_t went = write(board->port, board->out.bytes, board->out.used);
    if (went <= 0) return;
    drop(&board->out, (size_t)went);
  }
}
