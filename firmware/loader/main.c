// The loader: after every reset it starts the application, finishes a copy that was cut off, or stays at the line.
#include <stdint.h>

#include "../hal/reset.h"
#include "../src/core/protocol.h"
#include "application.h"
#include "chip.h"
#include "install.h"
#include "serve.h"
#include "vectors.h"

// Makes up for an application that is not sound by the image in staging. It returns only if that does not help.
static uint8_t restore(void)
{
    chip_stay();
    uint8_t result = install();
    if (result == RESULT_DONE)
        reset_now(NOTE_LOADER);
    return result == RESULT_FLASH_FAILED ? STAY_FLASH_FAILED : STAY_NO_APPLICATION;
}

void main(void)
{
    chip_start();
    if (reset_take_note(NOTE_UPDATE)) {
        chip_stay();
        serve(STAY_ASKED);
    }
    uint8_t obstacle = application_obstacle();
    if (obstacle == STAY_NONE)
        application_start();
    if (obstacle == STAY_NO_APPLICATION)
        obstacle = restore();
    else
        chip_stay();
    serve(obstacle);
}
