"""Answers to an engineer's questions: each takes a scene and returns numbers with their errors."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "answers.analysis": "analyse Analysis build_with_free derive_equations find_loop_margins plant_and_designs",
        "answers.at_rest": "examine find_bending",
        "answers.audit": "Audit Measure Row find_reach",
        "answers.audit.judging": "Judge",
        "answers.audit.versions": "list_effect_versions read_scale",
        "answers.clock": "Budget Clock DRAWING Step limited time_limit",
        "answers.campbell": "unfold_frequencies",
        "answers.disturbed": "answer_in_scene answer_noise overshoot respond settling_time",
        "answers.disturbed.stated": "state_disturbance",
        "answers.judging": "arm_length judge_model Loop SMALL",
        "answers.loops": "choose_loop",
        "answers.critical_values": "CriticalValue choose_margins find_margin Margin UNASKED",
        "answers.nearest": "make_box search_box",
        "answers.sensitivity": "choose_paths",
        "answers.spectra": "make_family",
        "answers.sweep": "check_values",
        "answers.sweep.found": "Found",
        "answers.sweep.job": "compute_here prepare_job",
        "answers.sweep.run": "choose_crew keep_in",
        "answers.sweep.sharing": "share_among_processes share_among_threads share_on_cluster",
        "answers.sweep.together": "Together",
    },
)
