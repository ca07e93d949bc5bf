"""What an analysis becomes: pages, pictures, JSON, netCDF, text in the terminal."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {},
    within={
        "report.advice": "advise",
        "report.animation": "animation_page collect_frames",
        "report.charts": "draw_charts say_bending",
        "report.exports": "export_all",
        "report.figures": "draw_pictures FIGURES",
        "report.figures.chart": "choose_scale thin",
        "report.figures.chart_map": "trace_contour",
        "report.figures.effects": "draw_effects draw_sensitivity",
        "report.figures.exponents": "scale_radius",
        "report.margins": "describe_endured describe_margins",
        "report.minimal": "minimal_text",
        "report.numbers": "audit_block record record_endured record_loop record_margin record_numbers to_json",
        "report.page": "render_page",
        "report.progress": "Progress",
        "report.terminal": "accuracy_lines audit_lines loop_line",
        "report.wording": "caution format_quantity scale_values typeset units_of",
        "report.writing": "write_report",
    },
)
