#include "output/image/srgb.h"

double cts_srgb_to_linear(double display)
{
    if (!(display > 0))
        return 0;
    return display <= 0.04045 ? display / 12.92 : pow((display + 0.055) / 1.055, 2.4);
}

double cts_linear_to_srgb(double linear)
{
    if (!(linear > 0))
        return 0;
    return linear <= 0.0031308 ? linear * 12.92 : 1.055 * pow(linear, 1 / 2.4) - 0.055;
}
