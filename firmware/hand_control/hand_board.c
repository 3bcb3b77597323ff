/* SPDX-License-Identifier: Apache-2.0 */
#include "hand_board.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>

#include "TaxelWire.h"
#include "hand_logic.h"
#include "ina226.h"
#include "settings.h"

#define RATE_HZ 1000
#define BEAT_MS 50    /* between heartbeats; also at once where the state changes */
#define CURRENT_MS 10 /* between current messages */

static const uint8_t addresses[] = {HAND_SENSORS};
static const uint8_t sensor_of_motor[] = {HAND_SENSOR_OF_MOTOR};
static const char board_id[] = TAXEL_BOARD_ID;
_Static_assert(HAND_MOTORS >= 1 && HAND_MOTORS <= 4, "1 to 4 motors");
_Static_assert(sizeof sensor_of_motor == HAND_MOTORS, "a sensor for each motor");
_Static_assert(sizeof addresses >= 1 && sizeof addresses <= HAND_MOTORS, "1 to 4 sensors");

static const hand_config config = {
    .motors = HAND_MOTORS,
    .sensor_of_motor = sensor_of_motor,
    .sensors = sizeof addresses,
    .over_ma = HAND_OVER_MA,
    .stroke_ms = HAND_STROKE_MS,
    .blank_ms = HAND_BLANK_MS,
    .watchdog_ms = HAND_WATCHDOG_MS,
    .reverse_ms = 50,
    .contact_readings = 3,
    .over_readings = 2,
    .lost_readings = 2,
    .good_readings = 10,
};

static hand it;
static taxel_decoder decoder;
static uint32_t boot_id;
static volatile uint32_t ticks; /* milliseconds since boot */
static uint32_t done_ticks, beat_ms, current_ms;
static uint8_t told_state, checked;
static uint8_t ready[sizeof addresses]; /* set up since its power came */

/* Timer 3 drives pin 5 (OC3A, PE3), timer 4 pins 6, 7, 8 (OC4A, B, C: PH3, PH4, PH5). */
static void motors_off(void) {
  TCCR3A &= (uint8_t) ~(_BV(COM3A1) | _BV(COM3A0));
  TCCR4A = _BV(WGM40);
  PORTE &= (uint8_t)~_BV(PE3);
  PORTH &= (uint8_t) ~(_BV(PH3) | _BV(PH4) | _BV(PH5));
}

static void drive(uint8_t m, int8_t on) {
  static volatile uint16_t *const compare[] = {&OCR3A, &OCR4A, &OCR4B, &OCR4C};
  static volatile uint8_t *const control[] = {&TCCR3A, &TCCR4A, &TCCR4A, &TCCR4A};
  static const uint8_t com[] = {_BV(COM3A1), _BV(COM4A1), _BV(COM4B1), _BV(COM4C1)};
  uint8_t sreg = SREG;
  cli();
  if (on == 0) {
    *control[m] &= (uint8_t)~com[m]; /* the pin falls back to its port bit, which is low */
  } else {
    if (on < 0) PORTA |= (uint8_t)(1U << m);
    else PORTA &= (uint8_t)~(1U << m);
    *compare[m] = HAND_DUTY;
    *control[m] |= com[m];
  }
  SREG = sreg;
}

static void drive_all(void) {
  for (uint8_t m = 0; m < HAND_MOTORS; m++) drive(m, it.motor[m].on);
}

void taxel_on_tick(void) { ticks++; }

static uint32_t ticks_now(void) {
  uint8_t sreg = SREG;
  cli();
  uint32_t now = ticks;
  SREG = sreg;
  return now;
}

static taxel_head head_now(void) {
  taxel_head head = {TAXEL_BOARD, ticks_now(), taxel_now_us()};
  return head;
}

static void say_hello(void) {
  uint8_t payload[TAXEL_LONGEST_PAYLOAD];
  taxel_head head = head_now();
  taxel_hello hello = {
      .protocol = TAXEL_PROTOCOL,
      .firmware = {1, 0, 0},
      .boot_id = boot_id,
      .rate_hz = RATE_HZ,
      .channels = 0,
      .adc_bits = 10,
      .reference_mv = 5000,
      .abilities = TAXEL_CURRENTS | TAXEL_MOTION,
      .id_size = sizeof board_id - 1,
      .id = board_id,
  };
  taxel_uart_send(payload, taxel_pack_hello(payload, &head, &hello));
}

static void acknowledge(const taxel_acknowledge *answer) {
  uint8_t payload[TAXEL_LONGEST_PAYLOAD];
  taxel_head head = head_now();
  taxel_uart_send(payload, taxel_pack_acknowledge(payload, &head, answer));
}

static void hear(uint8_t size) {
  taxel_head head;
  taxel_command command;
  uint8_t kind = taxel_kind_of(decoder.bytes, size);
  if (kind == TAXEL_NO_MESSAGE) {
    decoder.bad.message++;
    return;
  }
  taxel_read_head(decoder.bytes, &head);
  if (head.board != TAXEL_BOARD && head.board != TAXEL_EVERY_BOARD) return;
  if (kind == TAXEL_HEARTBEAT) hand_beat(&it, ticks_now());
  if (kind != TAXEL_COMMAND) return;
  taxel_read_command(decoder.bytes, &command);
  taxel_acknowledge answer = {head.seq, head.t_us, 0};
  answer.result = hand_obey(&it, &head, &command, ticks_now());
  drive_all();
  acknowledge(&answer);
  if (command.order == TAXEL_IDENTIFY) say_hello();
}

static void listen(void) {
  int16_t byte;
  while ((byte = taxel_uart_read()) >= 0) {
    uint8_t size = taxel_decode(&decoder, (uint8_t)byte);
    if (size) hear(size);
  }
}

static void read_sensor(uint8_t s) {
  uint16_t counts = 0;
  uint8_t good = ready[s] && ina226_read(addresses[s], INA226_SHUNT, &counts);
  /* In turn each sensor is asked for its setting too: a bus held low reads as no current at
   * all, and a sensor that lost its power has forgotten what it was told. */
  if (s == checked) {
    uint16_t setting;
    if (!ready[s]) ready[s] = ina226_set_up(addresses[s]);
    else if (!ina226_read(addresses[s], INA226_CONFIG, &setting) || setting != INA226_SETTING)
      good = ready[s] = 0;
  }
  hand_reading(&it, s, good, ina226_milliamps(counts, HAND_SHUNT_MOHM), ticks_now());
  drive_all();
}

static void report(uint32_t now_ms) {
  uint8_t payload[TAXEL_LONGEST_PAYLOAD];
  if (now_ms - current_ms >= CURRENT_MS) {
    int16_t milliamps[HAND_MOTORS];
    taxel_head head = head_now();
    current_ms = now_ms;
    for (uint8_t m = 0; m < HAND_MOTORS; m++) milliamps[m] = it.motor[m].ma;
    taxel_uart_send(payload, taxel_pack_current(payload, &head, milliamps, HAND_MOTORS));
  }
  if (now_ms - beat_ms >= BEAT_MS || it.state != told_state) {
    taxel_head head = head_now();
    taxel_heartbeat beat = {it.state, 0, taxel_bad_total(&decoder.bad)};
    beat_ms = now_ms;
    if (taxel_uart_send(payload, taxel_pack_heartbeat(payload, &head, &beat)))
      told_state = it.state;
  }
}

static void every_millisecond(uint32_t now_ms) {
  if (hand_tick(&it, now_ms)) acknowledge(&it.ran_out);
  drive_all();
  for (uint8_t s = 0; s < sizeof addresses; s++) {
    read_sensor(s);
    listen(); /* a stop does not wait for four sensors */
  }
  checked = (uint8_t)((checked + 1) % sizeof addresses);
  report(now_ms);
  wdt_reset();
}

void hand_begin_board(void) {
  MCUSR = 0;
  wdt_disable();
  motors_off();
  DDRE |= _BV(PE3);
  DDRH |= _BV(PH3) | _BV(PH4) | _BV(PH5);
  DDRA |= (uint8_t)((1U << HAND_MOTORS) - 1);
  TCCR3A = TCCR4A = _BV(WGM30); /* 8 bits, phase correct */
  TCCR3B = TCCR4B = _BV(CS31);  /* at 3.9 kHz */
  hand_start(&it, &config);
  boot_id = taxel_boot_id();
  taxel_uart_begin(TAXEL_BAUD);
  ina226_begin();
  taxel_tick_every(1000);
  say_hello();
  set_sleep_mode(SLEEP_MODE_IDLE);
  wdt_enable(WDTO_60MS);
}

void hand_run_board(void) {
  listen();
  uint32_t now_ms = ticks_now();
  if (now_ms != done_ticks) {
    done_ticks = now_ms;
    every_millisecond(now_ms);
  }
  cli();
  if (ticks == done_ticks && !taxel_uart_waiting()) {
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
  }
  sei();
}
