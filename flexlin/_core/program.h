/* A recorded program of scalar operations, carried out for WIDE points together: a slot of its memory is a row of WIDE numbers. */
#ifndef FLEXLIN_PROGRAM_H
#define FLEXLIN_PROGRAM_H

enum { WIDE = 32, FEW = 8 };

typedef struct { int op, to, a, b; } Step; /* CasADi's number of the operation, slots; a constant stands in a, b and has its eight bytes there */

/* Carry out the steps for `wide` points, WIDE or FEW, on memory (slots, wide). Returns 0, or the number of a step whose operation is not known. */
long run_steps(int wide, long steps, const Step *code, double *memory);

/* Carry out a laid-out program for many points, from the inputs to the outputs. Returns 0, or the number of a step that is not known. */
long run_program(long steps, const Step *code, long points, const double *const *in, const long *rows, double *const *out, const long *sizes,
                 double *work);

#endif
