// The board: what is wired to which pin (the table in ../hardware/wiring.md).
#ifndef PINS_H
#define PINS_H

#include <stdbool.h>

// Sets every pin's direction and gives UART0 and CEX0 theirs.
void pins_start(void);

void pins_set_trigger(bool high);
void pins_set_led(bool lit);
void pins_power_sensor(bool on); // if the board can cut its power
bool pins_echo_is_high(void);
bool pins_button_is_pressed(void);
bool pins_home_is_closed(void);

#endif
