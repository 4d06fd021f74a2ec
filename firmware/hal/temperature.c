// The chip's temperature sensor: ADC0 against ground, with the internal reference (datasheet chapters "10-Bit ADC" and
// "Voltage Reference").
#include "temperature.h"

#include "chip.h"

#define SYSCLK_PER_SAR_CLOCK 17 // 2.82 MHz: below 3 MHz, the fastest, with an oscillator 1.5 % fast too

void temperature_start(void)
{
    REF0CN = REF0CN_TEMPE | REF0CN_BIASE | REF0CN_REFBE;
    AMX0P = AMX0P_TEMPERATURE;
    AMX0N = AMX0N_GROUND;
    ADC0CF = (uint8_t)((SYSCLK_PER_SAR_CLOCK - 1) << ADC0CF_AD0SC_SHIFT);
    ADC0CN = ADC0CN_AD0EN; // tracks the sensor whenever it does not convert
}

uint16_t temperature_code(void)
{
    AD0INT = 0;
    AD0BUSY = 1;
    while (!AD0INT) // AD0BUSY itself may still read 0 at first
        ;
    return ADC0;
}
