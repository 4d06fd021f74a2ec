// The board's pins by name, for hal/*.c alone.
#ifndef BOARD_H
#define BOARD_H

#include "chip.h"

#define PIN_ECHO P1_0
#define PIN_TRIGGER P1_1
#define PIN_LED P1_2
#define PIN_BUTTON P1_3
#define PIN_HOME P1_4
#define PIN_SENSOR_POWER P1_6 // open drain
#define PORT_COILS P2 // IN1-IN4 on bits 0-3; bits 4-7 are unused inputs and stay 1
#define COILS_OFF 0xF0

#endif
