/*
 * What the policy decided in attjax; included by attjax_test.c alone.
 *
$facts
 */
#ifndef ATTJAX_VECTORS_H
#define ATTJAX_VECTORS_H

/* Steps of 1/240 s with torque and without it after a decision, and decisions in a slew. */
#define TORQUE_STEPS $torque_steps
#define COASTING_STEPS $coasting_steps
#define DECISIONS $decisions

/* The inertia tensor, kg m^2, and its inverse. */
static const double inertia[3][3] = $tensor;
static const double inverse[3][3] = $inverse;

/* Slews from rest, and their error (degrees) and rate (rad/s) at the end in attjax. */
#define SLEWS $slews
static const double slew_start[SLEWS][4] = $slew_start;
static const double slew_error_deg[SLEWS] = $slew_error_deg;
static const double slew_rate[SLEWS] = $slew_rate;

/* States of random slews, $compared. */
#define VECTORS $vectors
static const struct {
    float quaternion[4];
    float angular_velocity[3];
    $decision;
} vectors[VECTORS] = $vector_values;

#endif
