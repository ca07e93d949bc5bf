"""Analyses of scenes: each answers an engineer's question, and returns numbers with their errors."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "analyses.analysis": (
            "analyse Analysis build_with_free derive_equations find_loop_margins plant_and_designs simulation_error"
        ),
        "analyses.audit": "Audit Judge Measure Row find_reach",
        "analyses.audit.versions": "list_effect_versions read_scale",
        "analyses.clock": "Clock DRAWING_SHARE Step limited time_limit",
        "analyses.disturbed": "answer_in_scene answer_noise overshoot respond settling_time",
        "analyses.disturbed.stated": "state_disturbance",
        "analyses.judging": "arm_length examine find_bending judge_model Loop SMALL_SHARE",
        "analyses.loops": "choose_loop",
        "analyses.boundary": "CriticalValue choose_margins find_margin Margin UNASKED_SECONDS",
        "analyses.nearest": "make_box search_box",
        "analyses.sensitivity": "choose_paths",
        "analyses.spectra": "make_family unfold_frequencies",
        "analyses.sweep.found": "Found",
        "analyses.sweep.job": "choose_crew compute_here prepare_job Store",
        "analyses.sweep.sharing": "share_among_processes share_among_threads share_on_cluster",
        "analyses.sweep.together": "Together",
    },
)
