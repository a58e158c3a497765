/* A model is one array of numbers: its variables, as layout.h places them, then its memory. */
#ifndef MODEL_H
#define MODEL_H

#include "layout.h"

#define MEMORY 15
#define GRAVITY 9.81 /* m/s^2 */

/* Begins at the start values: writes memory and outputs. */
void model_begin(double v[]);

/* Goes on by h (s) with held inputs. Returns what went wrong, NULL if nothing did. */
const char *model_step(double v[], double h);

#endif
