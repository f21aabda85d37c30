/* What the policy decided in attjax $version; included by attjax_test.c alone. */
#ifndef ATTJAX_VECTORS_H
#define ATTJAX_VECTORS_H

/* Torque-free steps of 1/240 s after the one with torque, and decisions in a slew. */
#define COASTING_STEPS $frameskip
#define DECISIONS $decisions

/* Principal moments of inertia, kg m^2. */
static const double inertia[3] = $inertia_values;

/* Slews from rest, and their error (degrees) and rate (rad/s) at the end in attjax. */
#define SLEWS $slews
static const double slew_start[SLEWS][4] = $slew_start;
static const double slew_error_deg[SLEWS] = $slew_error_deg;
static const double slew_rate[SLEWS] = $slew_rate;

/* States of random slews, whose decision does not hang on rounding. */
#define VECTORS $vectors
static const struct {
    float quaternion[4];
    float angular_velocity[3];
    int action;
} vectors[VECTORS] = $vector_values;

#endif
