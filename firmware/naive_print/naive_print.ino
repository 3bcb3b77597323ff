/* SPDX-License-Identifier: Apache-2.0
 *
 * The usual sketch, to measure ours against: read all analog pins in the loop and print them.
 */
void setup() { Serial.begin(115200); }

void loop() {
  for (uint8_t pin = 0; pin < 16; pin++) {
    if (pin) Serial.print(',');
    Serial.print(analogRead(A0 + pin));
  }
  Serial.println();
}
