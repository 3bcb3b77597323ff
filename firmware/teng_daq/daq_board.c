/* SPDX-License-Identifier: Apache-2.0 */
#include "daq_board.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "TaxelWire.h"
#include "daq_logic.h"
#include "settings.h"

#define BEAT_US 50000UL /* between heartbeats; the specification wants one in 100 ms */

static const uint8_t channels[] = {TAXEL_CHANNELS};
static const char board_id[] = TAXEL_BOARD_ID;
_Static_assert(sizeof channels >= 1 && sizeof channels <= DAQ_PINS, "1 to 16 channels");
_Static_assert(sizeof board_id - 1 <= TAXEL_LONGEST_ID, "an id of at most 32 characters");
_Static_assert(TAXEL_ADC_PRESCALER == 128 || TAXEL_ADC_PRESCALER == 64 ||
                   TAXEL_ADC_PRESCALER == 32 || TAXEL_ADC_PRESCALER == 16,
               "a prescaler of 16, 32, 64 or 128");

/* A conversion as the registers want it. */
typedef struct {
  uint8_t admux, adcsrb, keep;
} conversion;

typedef struct {
  uint32_t seq, t_us;
  uint16_t values[DAQ_PINS];
} scan;

static daq board;
static daq_timing timing;
static uint32_t boot_id;
static taxel_decoder decoder;
static uint32_t beat_us;

static conversion plan[2 * DAQ_PINS];
static const conversion *plan_end;

/* Two scans: the interrupts fill one while the main loop sends the other. */
static scan scans[2];
static scan *volatile filling = &scans[0];
static volatile uint8_t full; /* the other one waits to be sent */
static volatile uint32_t dropped;
static volatile uint32_t due; /* ticks since boot: the seq of the next scan */
static uint16_t ticks_left;
static volatile uint8_t converting;
static const conversion *step;
static uint16_t *value;

static inline void start(void) {
  ADMUX = step->admux;
  ADCSRB = step->adcsrb;
  ADCSRA |= _BV(ADSC);
}

void taxel_on_tick(void) {
  if (--ticks_left) return;
  ticks_left = timing.ticks_a_scan;
  uint32_t seq = due++;
  if (converting) return; /* the last scan goes on: this one is missed, and leaves a hole in seq */
  converting = 1;
  filling->seq = seq;
  filling->t_us = taxel_tick_us();
  value = filling->values;
  step = plan;
  start();
}

ISR(ADC_vect) {
  uint16_t count = ADC; /* before the multiplexer moves on */
  uint8_t keep = step->keep;
  if (++step != plan_end) start();
  else converting = 0;
  if (keep) *value++ = count;
  if (converting) return;
  if (full) {
    dropped++; /* the main loop has not taken the scan before; that one is kept */
  } else {
    filling = filling == &scans[0] ? &scans[1] : &scans[0];
    full = 1;
  }
}

static taxel_head head_now(void) {
  uint8_t sreg = SREG;
  cli();
  taxel_head head = {TAXEL_BOARD, due, 0};
  SREG = sreg;
  head.t_us = taxel_now_us();
  return head;
}

static void say_hello(void) {
  uint8_t payload[TAXEL_LONGEST_PAYLOAD];
  taxel_head head = head_now();
  taxel_hello hello = {
      .protocol = TAXEL_PROTOCOL,
      .firmware = {1, 0, 0},
      .boot_id = boot_id,
      .rate_hz = timing.rate_hz,
      .channels = board.channels,
      .adc_bits = 10,
      .reference_mv = TAXEL_REFERENCE_MV,
      .abilities = TAXEL_SENSORS,
      .id_size = sizeof board_id - 1,
      .id = board_id,
  };
  taxel_uart_send(payload, taxel_pack_hello(payload, &head, &hello));
}

static void set_rate(uint16_t rate_hz) {
  uint8_t sreg = SREG;
  cli();
  if (daq_timing_of(&board, rate_hz, &timing)) {
    taxel_tick_every(timing.tick_us);
    ticks_left = timing.ticks_a_scan;
  }
  SREG = sreg;
}

static void hear(uint8_t size) {
  taxel_head head;
  taxel_command command;
  uint8_t hello, payload[TAXEL_LONGEST_PAYLOAD];
  uint16_t rate_hz = 0;
  uint8_t kind = taxel_kind_of(decoder.bytes, size);
  if (kind == TAXEL_NO_MESSAGE) decoder.bad.message++;
  if (kind != TAXEL_COMMAND) return;
  taxel_read_head(decoder.bytes, &head);
  taxel_read_command(decoder.bytes, &command);
  if (head.board != TAXEL_BOARD && head.board != TAXEL_EVERY_BOARD) return;
  taxel_acknowledge answer = {head.seq, head.t_us, 0};
  answer.result = daq_obey(&board, &head, &command, &hello, &rate_hz);
  if (rate_hz) set_rate(rate_hz);
  head = head_now();
  taxel_uart_send(payload, taxel_pack_acknowledge(payload, &head, &answer));
  if (hello) say_hello();
}

static void send_scan(void) {
  uint8_t payload[TAXEL_LONGEST_PAYLOAD];
  const scan *taken = filling == &scans[0] ? &scans[1] : &scans[0];
  taxel_head head = {TAXEL_BOARD, taken->seq, taken->t_us};
  uint8_t sent =
      taxel_uart_send(payload, taxel_pack_data(payload, &head, taken->values, board.channels));
  uint8_t sreg = SREG;
  cli();
  if (!sent) dropped++;
  full = 0;
  SREG = sreg;
}

static void beat(void) {
  uint8_t payload[TAXEL_LONGEST_PAYLOAD];
  taxel_head head = head_now();
  if (head.t_us - beat_us < BEAT_US) return;
  beat_us = head.t_us;
  uint8_t sreg = SREG;
  cli();
  taxel_heartbeat beat = {TAXEL_IDLE, dropped, 0};
  SREG = sreg;
  beat.bad = taxel_bad_total(&decoder.bad);
  taxel_uart_send(payload, taxel_pack_heartbeat(payload, &head, &beat));
}

void daq_begin(void) {
  daq_step steps[2 * DAQ_PINS];
  board.board = TAXEL_BOARD;
  board.channels = sizeof channels;
  board.steps = daq_plan(channels, sizeof channels, TAXEL_GROUND_READS, steps);
  board.prescaler = TAXEL_ADC_PRESCALER;
  board.baud = TAXEL_BAUD;
  for (uint8_t i = 0; i < board.steps; i++) {
    plan[i].admux = (uint8_t)(TAXEL_REFERENCE << REFS0 | (steps[i].pin & 7));
    plan[i].adcsrb = steps[i].pin > 7 ? _BV(MUX5) : 0;
    plan[i].keep = steps[i].keep;
  }
  plan_end = plan + board.steps;
  DIDR0 = 0xFF; /* no digital inputs on the analog pins: less noise, less current */
  DIDR2 = 0xFF;
  ADCSRA = _BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | (TAXEL_ADC_PRESCALER >= 64 ? _BV(ADPS1) : 0) |
           (TAXEL_ADC_PRESCALER == 128 || TAXEL_ADC_PRESCALER == 32 ? _BV(ADPS0) : 0);
  boot_id = taxel_boot_id();
  taxel_uart_begin(TAXEL_BAUD);
  set_rate(TAXEL_RATE_HZ);
  say_hello();
  set_sleep_mode(SLEEP_MODE_IDLE);
}

void daq_run(void) {
  int16_t byte;
  if (full) send_scan();
  while ((byte = taxel_uart_read()) >= 0) {
    uint8_t size = taxel_decode(&decoder, (uint8_t)byte);
    if (size) hear(size);
    if (full) send_scan();
  }
  beat();
  cli();
  if (!full && !taxel_uart_waiting()) { /* nothing to do until the next interrupt */
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
  }
  sei();
}
