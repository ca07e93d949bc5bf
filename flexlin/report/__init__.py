"""What an analysis becomes: pages, pictures, JSON, netCDF, text in the terminal."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "report.advice": "advise",
        "report.audit": "audit_lines draw_effects draw_sensitivity fitting minimal_text",
        "report.animation": "animation_page collect_frames",
        "report.charts": "Chart draw_charts find_boundary say_bending",
        "report.exports": "export_all",
        "report.figures.chart": "choose_scale thin trace_contour",
        "report.figures.exponents": "scale_radius",
        "report.numbers": "audit_block record record_endured record_loop record_margin to_json",
        "report.page": "draw_pictures FIGURES render_page",
        "report.wording": "accuracy_lines describe_endured describe_margins format_quantity loop_line scale_values typeset units_of",
        "report.writing": "write_report",
    },
)
