"""The coefficients of a parametric loop as C, parted into what the phase, the parameters, or both decide: for the compiled kernel."""

import math

import casadi as ca

from flexlin.about.free import ParametricLoop
from flexlin.about.instructions import Instruction, Needs, Program, read_program
from flexlin.errors import ArgumentError

ARITHMETIC = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_INV: "1.0 / {0}",
}
"""Written alike for scalars and vectors."""
FUNCTIONS = {
    getattr(ca, f"OP_{name.upper()}"): name
    for name in (
        "exp", "log", "pow", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "floor", "ceil", "fmod", "fabs", "copysign",
        "erf", "fmin", "fmax", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "atan2", "log1p", "expm1", "hypot", "remainder",
    )
} | {ca.OP_CONSTPOW: "pow"}  # fmt: skip
COMPARISONS = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!=", ca.OP_AND: "&", ca.OP_OR: "|"}


def write_model(loop: ParametricLoop) -> str:
    """C source of the coefficients X = -T^2 M^-1 K, Y = -T M^-1 D, time in units of the period T.

    Three functions: of the phase alone, once for each node; of the parameters alone, once for each eight values; and the rest.
    Raises: ArgumentError where an expression holds what has no C here.
    """
    program = read_program(reduced_equations(loop), point=1)
    n, counted = loop.coordinates, program.instructions
    kept: dict[Needs, list[int]] = {Needs.PHASE: [], Needs.POINT: []}
    wanted = {i for one in counted if one.needs == Needs.BOTH for i in one.arguments} | {
        i for o in program.outputs for i in o
    }
    for i in sorted(wanted):
        if counted[i].needs in kept:
            kept[counted[i].needs].append(i)
    phase_inputs = 1 if loop.kept is None else 1 + loop.states * loop.linearization.about.m
    sizes = {"COORDINATES": n, "PARAMETERS": len(loop.paths), "PHASE_INPUTS": phase_inputs}
    sizes |= {"PHASE_VALUES": len(kept[Needs.PHASE]), "POINT_VALUES": len(kept[Needs.POINT])}
    lines = [
        f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())} }};",
        *split_program(program, kept),
    ]
    return "\n".join(lines) + "\n"


def reduced_equations(loop: ParametricLoop) -> ca.Function:
    """(phase, p[, gain]) -> X, Y, the pivots of M, T: y'' = X y + Y y' with the mass matrix eliminated in symbols, without pivoting."""
    inputs = loop.matrices.sx_in()
    M, D, K = loop.matrices.call(inputs)
    T, n = loop.duration(inputs[1]), loop.coordinates
    M, Z, pivots, inverses = ca.SX(M), ca.horzcat(T**2 * K, T * D), [], []
    for j in range(n):
        pivots.append(M[j, j])
        inverses.append(1 / M[j, j])
        for i in range(j + 1, n):
            factor = M[i, j] * inverses[j]
            M[i, j + 1 :] -= factor * M[j, j + 1 :]
            Z[i, :] -= factor * Z[j, :]
    for j in reversed(range(n)):
        for i in range(j + 1, n):
            Z[j, :] -= M[j, i] * Z[i, :]
        Z[j, :] *= inverses[j]
    outputs = [-Z[:, :n].T, -Z[:, n:].T, ca.vertcat(*pivots), T]  # transposed: column by column is then row by row
    return ca.Function("reduced", inputs, [ca.densify(output) for output in outputs])


def split_program(program: Program, kept: dict[Needs, list[int]]) -> list[str]:
    """The three functions, line by line."""
    n2, pivots = len(program.outputs[0]), program.outputs[2]
    stored = {i: f"f[{k}]" for k, i in enumerate(kept[Needs.PHASE])} | {
        i: f"w[{k}]" for k, i in enumerate(kept[Needs.POINT])
    }
    period = program.outputs[3][0]
    of_phase = write_part(program, Needs.PHASE, {})
    of_point = write_part(program, Needs.POINT, {})
    both = write_part(program, Needs.BOTH, stored)

    def vector(i: int, names: dict[int, str]) -> str:
        one = program.instructions[i]
        name = literal(one) if one.code == ca.OP_CONST else names.get(i, f"x{i}")
        return name if one.needs & Needs.POINT else f"splat({name})"

    return [
        "static void of_phase(const double *u, double *f) {",
        *of_phase,
        *[f"  f[{k}] = x{i};" for k, i in enumerate(kept[Needs.PHASE])],
        "}",
        "static v8 of_point(const v8 *p, v8 *w) {",
        *of_point,
        *[f"  w[{k}] = x{i};" for k, i in enumerate(kept[Needs.POINT])],
        f"  return {vector(period, {})};",
        "}",
        "static m8 at_node(const double *restrict f, const v8 *restrict w, v8 *restrict X, v8 *restrict Y) {",
        *both,
        *[f"  X[{k}] = {vector(program.outputs[0][k], stored)};" for k in range(n2)],
        *[f"  Y[{k}] = {vector(program.outputs[1][k], stored)};" for k in range(n2)],
        f"  return (m8)({' & '.join(f'({vector(i, stored)} > 0.0)' for i in dict.fromkeys(pivots))});",
        "}",
    ]


def write_part(program: Program, needs: Needs, stored: dict[int, str]) -> list[str]:
    """The instructions of one kind; what another part has computed is read from where it is stored."""
    lines = []
    kind = "v8" if needs & Needs.POINT else "double"
    for i, one in enumerate(program.instructions):
        if one.needs != needs:
            continue
        if one.code == ca.OP_INPUT:
            lines.append(f"  const {kind} x{i} = {'p' if needs == Needs.POINT else 'u'}[{one.place}];")
        else:
            lines.append(f"  const {kind} x{i} = {write_operation(program, one, stored)};")
    return lines


def write_operation(program: Program, one: Instruction, stored: dict[int, str]) -> str:
    """The right side of one instruction."""
    arguments = [program.instructions[i] for i in one.arguments]
    names = [
        literal(a) if a.code == ca.OP_CONST else stored.get(i, f"x{i}")
        for i, a in zip(one.arguments, arguments, strict=True)
    ]
    if one.code in ARITHMETIC:
        return ARITHMETIC[one.code].format(*names)
    vector = bool(one.needs & Needs.POINT)
    if vector:
        names = [name if a.needs & Needs.POINT else f"splat({name})" for name, a in zip(names, arguments, strict=True)]
    if one.code in COMPARISONS:
        if one.code in (ca.OP_AND, ca.OP_OR):
            names = [f"({name} != 0.0)" for name in names]
        truth = f"{names[0]} {COMPARISONS[one.code]} {names[1]}"
        return f"v_of((m8)({truth}))" if vector else f"(double)({truth})"
    if one.code == ca.OP_NOT:
        return f"v_of((m8)({names[0]} == 0.0))" if vector else f"(double)({names[0]} == 0.0)"
    if one.code == ca.OP_IF_ELSE_ZERO:
        return f"v_if({names[0]}, {names[1]})" if vector else f"({names[0]} != 0.0 ? {names[1]} : 0.0)"
    if one.code == ca.OP_SIGN:
        return f"{'v' if vector else 's'}_sign({names[0]})"
    if one.code not in FUNCTIONS:
        raise ArgumentError("an operation of the expressions has no C", got=f"CasADi operation {one.code}")
    name = FUNCTIONS[one.code]
    if vector:
        name = "v_log_any" if name == "log" else f"v_{name}"
    return f"{name}({', '.join(names)})"


def literal(one: Instruction) -> str:
    """A number in C, to the last bit."""
    if math.isfinite(one.number):
        return f"({one.number!r})" if one.number < 0 else repr(float(one.number))
    return "NAN" if math.isnan(one.number) else "(-INFINITY)" if one.number < 0 else "INFINITY"
