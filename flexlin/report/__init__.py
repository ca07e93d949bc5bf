"""What an analysis becomes: words, pages, pictures, JSON, netCDF."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "report.advice": "advise drive_line",
        "report.audit": "audit_lines draw_effects draw_sensitivity fitting minimal_text",
        "report.animation": "animation_page collect_frames",
        "report.charts": "Chart chart_dataset compute_chart draw_charts find_boundary say_bending say_without_picture",
        "report.exports": "check_gains coefficients_dataset described design_folders export_all gains_dataset storable write_dataset",
        "report.figures.answers": "answer_lines answer_record draw_errors draw_prediction picture_answer say_numbers",
        "report.figures": "choose_scale",
        "report.figures.chart": "thin trace_contour",
        "report.figures.cost": "cost_table draw_cost summarise_cost",
        "report.figures.exponents": "scale_radius",
        "report.numbers": "audit_block record record_endured record_fields record_loop record_margin to_json",
        "report.page": "draw_pictures FIGURES picture_page render_page",
        "report.wording": (
            "accuracy_lines colour describe_endured describe_margins describe_nearest format_quantity loop_line reason scale_values "
            "typeset units_of units_of_scene with_unit with_unit_of"
        ),
        "report.writing": "write_report",
    },
)
