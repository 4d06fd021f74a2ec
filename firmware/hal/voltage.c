// VDD against VREF, with VREF as the reference (datasheet chapter "10-Bit ADC", differential mode): the result is signed.
#include "voltage.h"

#include "chip.h"

#define PASSES_TO_TRACK 20 // over 1 us, of which 0.3 would do

int16_t voltage_code(void)
{
    AMX0P = AMX0P_SUPPLY;
    AMX0N = AMX0N_REFERENCE;
    for (volatile uint8_t pass = PASSES_TO_TRACK; pass != 0; pass--)
        ;
    AD0INT = 0;
    AD0BUSY = 1;
    while (!AD0INT)
        ;
    int16_t code = (int16_t)ADC0;
    AMX0P = AMX0P_TEMPERATURE;
    AMX0N = AMX0N_GROUND;
    return code;
}
