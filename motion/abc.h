/* A Kalman filter, written by flexlin 0.1.0. C99, needs libm only; no memory is allocated.

   abc_rate(phase, estimate, measurement, torque, rate)    rate = (A - L C) estimate + B torque + L measurement
   abc_step(phase, step, measurement, torque, estimate)    moves the estimate by step s; measurement and torque are held;
                                                              returns 0, or 1 when the step cannot be made

   phase: t / T with T = 2.0 s at the beginning of the step; any number, taken modulo 1
   measurement, its deviation from what the rigid motion would give:
     [0] y1, no unit given
   torque, what is added to the feedforward:
     [0] u1, no unit given
   estimate, of the deviation from the rigid motion:
     [0] x1, no unit given
     [1] x2, no unit given
     [2] x3, no unit given
     [3] x4, no unit given
   A step is made by Gauss collocation with two stages: order 4, and stable however fast a mode decays.
   Largest error of A - L C, B, L against flexlin's, relative to the largest entry: 7.6e-16. */
#ifndef FLEXLIN_ABC_H
#define FLEXLIN_ABC_H
#define ABC_STATES 4
#define ABC_INPUTS 1
#define ABC_MEASUREMENTS 1
#define ABC_PERIOD 2.0
void abc_rate(double phase, const double *estimate, const double *measurement, const double *torque, double *rate);
int abc_step(double phase, double step, const double *measurement, const double *torque, double *estimate);
#endif
