// The board: port modes and crossbar (datasheet chapter "Port Input/Output").
#include "pins.h"

#include "board.h"

void pins_start(void)
{
    // Latches first, so that no output starts with a false level.
    P1 = 0xF9; // trigger and LED low, inputs pulled up
    PORT_COILS = COILS_OFF;

    P0MDOUT = 0x10; // TX0
    P1MDOUT = 0x06; // trigger, LED
    P2MDOUT = 0x0F; // coils
    P1MDIN = 0xDF; // VREF is P1.5: analog

    P0SKIP = 0xCF; // leaves UART0 its P0.4 and P0.5, so that CEX0 comes out at P1.0
    P1SKIP = 0x20; // VREF
    XBR0 = XBR0_URT0E;
    XBR1 = XBR1_XBARE | XBR1_CEX0;
}

void pins_set_trigger(bool high)
{
    PIN_TRIGGER = high;
}

void pins_set_led(bool lit)
{
    PIN_LED = lit;
}

void pins_power_sensor(bool on)
{
    PIN_SENSOR_POWER = on;
}

bool pins_echo_is_high(void)
{
    return PIN_ECHO;
}

bool pins_button_is_pressed(void)
{
    return !PIN_BUTTON;
}

bool pins_home_is_closed(void)
{
    return !PIN_HOME;
}
