/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Motors behind drivers with PWM and direction, and INA226 current sensors on I2C.
 *
 * A motor draws a start-up peak that fades, then its running current, and its stall current once
 * its finger meets something. Sensors hold the current at the end of their last conversion.
 */
#include <math.h>
#include <string.h>

#include "avr_twi.h"
#include "emulated.h"

#define PORTA 0x22
#define DDRA 0x21
#define PORTE 0x2E
#define DDRE 0x2D
#define PORTH 0x102
#define DDRH 0x101
#define TCCR3A 0x90
#define OCR3A 0x98
#define TCCR4A 0xA0
#define OCR4A 0xA8
#define TWCR 0xBC
#define TWSR 0xB9
#define TWINT 0x80

#define PEAK_S 0.015  /* fading time of the start-up peak */
#define TOUCH_S 0.002 /* rise of the current after contact */
#define RESET 0x4127  /* the configuration after power-on. Source: INA226 datasheet, SBOS547 */

/* PWM of the four motors: pins 5, 6, 7, 8 are OC3A on PE3 and OC4A, B, C on PH3, 4, 5. */
static const struct {
  uint16_t control, compare, port, direction;
  uint8_t com, bit;
} outputs[MOTORS] = {
    {TCCR3A, OCR3A, PORTE, DDRE, 6, 3},
    {TCCR4A, OCR4A, PORTH, DDRH, 6, 3},
    {TCCR4A, OCR4A + 2, PORTH, DDRH, 4, 4},
    {TCCR4A, OCR4A + 4, PORTH, DDRH, 2, 5},
};

static uint8_t duty_of(const uint8_t *data, int m) {
  if (!(data[outputs[m].direction] >> outputs[m].bit & 1)) return 0;
  if (data[outputs[m].control] >> outputs[m].com & 3) return data[outputs[m].compare];
  return data[outputs[m].port] >> outputs[m].bit & 1 ? 255 : 0;
}

void look_at_motors(emulated *board) {
  const uint8_t *data = board->avr->data;
  for (int m = 0; m < MOTORS; m++) {
    motor *one = &board->motors[m];
    uint8_t duty = duty_of(data, m);
    int on = duty ? (data[DDRA] & data[PORTA]) >> m & 1 ? -1 : 1 : 0;
    if (on == one->on && duty == one->duty) continue;
    if (on != one->on) one->since = board->avr->cycle;
    one->on = on;
    one->duty = duty;
    printf("event %d %.3f motor %d %d %d\n", board->number, outer_us(board), m, on, duty);
  }
}

static double current_ma(const motor *one, uint64_t cycle) {
  if (!one->on || cycle < one->since) return 0.0;
  double share = one->duty / 255.0;
  double ma = one->run_ma + (one->stall_ma - one->run_ma) *
                                exp(-(double)(cycle - one->since) / HZ / PEAK_S);
  if (one->touching && cycle > one->touched) {
    double rise = 1.0 - exp(-(double)(cycle - one->touched) / HZ / TOUCH_S);
    ma = fmax(ma, one->run_ma + (one->stall_ma - one->run_ma) * rise);
  }
  return ma * share;
}

/* Cycles of one conversion at this configuration: of the shunt, and of the bus where asked for. */
static uint64_t conversion_cycles(uint16_t config) {
  static const uint16_t us[8] = {140, 204, 332, 588, 1100, 2116, 4156, 8244};
  static const uint16_t of[8] = {1, 4, 16, 64, 128, 256, 512, 1024};
  uint32_t one = (config & 1 ? us[config >> 3 & 7] : 0) + (config & 2 ? us[config >> 6 & 7] : 0);
  return (uint64_t)(one ? one : 1) * of[config >> 9 & 7] * (HZ / 1000000);
}

static int16_t shunt_of(emulated *board, const sensor *one) {
  uint64_t now = board->avr->cycle;
  uint64_t each = conversion_cycles(one->config);
  uint64_t ended = one->configured + (now - one->configured) / each * each;
  double ma = 0.0;
  for (int m = 0; m < MOTORS; m++) {
    if (board->sensors == 1 || one == &board->ina[m]) ma += current_ma(&board->motors[m], ended);
  }
  double counts = floor(ma * board->shunt_mohm / 2.5);
  return counts > 32767 ? 32767 : (int16_t)counts;
}

static uint16_t read_register(emulated *board, sensor *one) {
  switch (one->pointer) {
    case 0x00: return one->config;
    case 0x01: return (uint16_t)shunt_of(board, one);
    case 0xFE: return 0x5449;
    case 0xFF: return 0x2260;
    default: return 0;
  }
}

static void write_register(emulated *board, sensor *one) {
  if (one->pointer != 0x00) return;
  one->config = one->written & 0x8000 ? RESET : one->written;
  one->configured = board->avr->cycle;
}

static void reply(emulated *board, uint8_t kind, uint8_t data) {
  avr_raise_irq(avr_io_getirq(board->avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_INPUT),
                avr_twi_irq_msg(kind, 0, data));
}

static void on_bus(struct avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq;
  emulated *board = param;
  avr_twi_msg_irq_t message = {.u.v = value};
  uint8_t kind = message.u.twi.msg;
  board->addressing = (kind & TWI_COND_START) != 0;
  if (board->fault == I2C_SILENT || board->fault == I2C_HANGS) return;
  if (kind & TWI_COND_STOP) board->selected = -1;
  if (kind & TWI_COND_START) {
    board->selected = -1;
    for (int s = 0; s < board->sensors; s++) {
      if (board->ina[s].address == message.u.twi.addr >> 1) board->selected = s;
    }
    if (board->fault == I2C_LOW) board->selected = 0; /* a line held low acknowledges everything */
    if (board->selected < 0) return;
    board->ina[board->selected].taken = 0;
    reply(board, TWI_COND_ACK, 1);
    return;
  }
  if (board->selected < 0) return;
  sensor *one = &board->ina[board->selected];
  if (kind & TWI_COND_WRITE) {
    reply(board, TWI_COND_ACK, 1);
    if (one->taken == 0) one->pointer = message.u.twi.data;
    else one->written = (uint16_t)(one->written << 8 | message.u.twi.data);
    if (++one->taken == 3) write_register(board, one);
  }
  if (kind & TWI_COND_READ) {
    uint16_t whole = board->fault == I2C_LOW ? 0 : read_register(board, one);
    reply(board, TWI_COND_READ, (uint8_t)(one->taken++ & 1 ? whole : whole >> 8));
  }
}

/* simavr 1.6 says "data sent" (28, 30) after an address to write to, where the chip says
 * "address sent" (18, 20). */
static void on_status(struct avr_irq_t *irq, uint32_t value, void *param) {
  (void)irq;
  emulated *board = param;
  if (!board->addressing) return;
  board->addressing = 0;
  if (value == 0x28 || value == 0x30) board->avr->data[TWSR] -= 0x10;
}

void hold_the_bus(emulated *board) {
  /* A clock line held low: what the firmware waits for never comes. */
  if (board->fault == I2C_HANGS) board->avr->data[TWCR] &= (uint8_t)~TWINT;
}

void sensors_lose_power(emulated *board) {
  for (int s = 0; s < MOTORS; s++) {
    board->ina[s].config = RESET;
    board->ina[s].pointer = 0;
    board->ina[s].configured = board->avr->cycle;
  }
}

void attach_power(emulated *board) {
  /* simavr 1.6 never clears TWINT for a program that polls it. */
  for (avr_io_t *io = board->avr->io_port; io; io = io->next) {
    if (!strcmp(io->kind, "twi")) ((avr_twi_t *)io)->twi.raise_sticky = 0;
  }
  static const uint8_t addresses[MOTORS] = {0x40, 0x41, 0x44, 0x45};
  for (int m = 0; m < MOTORS; m++) {
    board->ina[m].address = addresses[m];
    board->motors[m].run_ma = 300.0;
    board->motors[m].stall_ma = 1500.0;
  }
  board->selected = -1;
  sensors_lose_power(board);
  avr_irq_register_notify(avr_io_getirq(board->avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_OUTPUT),
                          on_bus, board);
  avr_irq_register_notify(avr_io_getirq(board->avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_STATUS),
                          on_status, board);
}
