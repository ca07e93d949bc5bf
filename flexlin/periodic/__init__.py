"""Periodic linear systems, numpy and scipy only: usable without any manipulator."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "periodic.boundary.crossings": "find_crossings",
        "periodic.boundary.curves": "find_curves find_tip",
        "periodic.boundary.spectra": "Effort Spectra",
        "periodic.boundary.together": "find_together",
        "periodic.certificate": "digest",
        "periodic.circle": "assign count_turns match_logs measure_distances wrap_angle",
        "periodic.coefficients": "build_companion stack_companion",
        "periodic.decoupling.coupling": "as_real Decoupled",
        "periodic.decoupling.decouple": "decouple",
        "periodic.decoupling.frames": "Group sylvester",
        "periodic.floquet.by_decoupling": "decoupled_exponents solve_decoupled_modes",
        "periodic.floquet.hill": "hill_spectrum",
        "periodic.floquet.modes": "differentiate_exponents follow_frozen_modes solve_modes_at_nodes",
        "periodic.floquet.resonance": "find_resonances",
        "periodic.floquet.result": "judge",
        "periodic.floquet.by_segments": "hidden_growth",
        "periodic.interpolation": (
            "chebyshev_coefficients ChebyshevPanels circle_derivative panel_times "
            "fourier_nodes FourierSeries place_edges"
        ),
        "periodic.many": "Kernel SIZES take_phases",
        "periodic.margins": "Margins",
        "periodic.product": "complex_schur find_spectrum Unknown",
        "periodic.riccati.riccati": "finite_horizon_riccati periodic_riccati",
        "periodic.coefficient_series.resolve": "resolve",
        "periodic.system": "extend_system",
        "periodic.transition.factors": "gauss_transitions",
        "periodic.transition.choose_segments": "factor_by METHODS Setting",
    },
)
