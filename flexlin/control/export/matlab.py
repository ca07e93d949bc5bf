"""A MATLAB script beside the .mat file: it rebuilds plant, gains and frozen loops with named states, and checks itself."""

from pathlib import Path

import flexlin

SCRIPT = """\
function arm = {function}(phase)
%{FUNCTION}  The arm of {data} as MATLAB objects; written by flexlin {version}, needs no toolbox unless stated.
%
%   arm = {function}()        arm.A(t), arm.B(t), arm.gain{{i}}(t): matrices at a time t in s, splines through the samples
%   arm = {function}(phase)   also arm.frozen and arm.loop{{i}} at phase = t / T in [0, 1): ss objects (Control System Toolbox)
%
%   x' = A(t) x + B(t) u,  u = -K(t) x,  x = [y; y'] the deviation from the rigid motion, u beside the feedforward torque.
%   States and inputs bear their names and units. A design with integrals has states z behind x: u = -K(t) [x; z], z' = rates [x; z].

data = load(fullfile(fileparts(mfilename('fullpath')), '{data}'));
arm.period = data.period;
arm.states = strtrim(cellstr(char(data.states)));
arm.state_units = strtrim(cellstr(char(data.state_units)));
arm.inputs = strtrim(cellstr(char(data.inputs)));
arm.input_units = strtrim(cellstr(char(data.input_units)));
n = numel(arm.states);
m = numel(arm.inputs);
arm.A = periodic(data.t, data.A, data.period, n, n);
arm.B = periodic(data.t, data.B, data.period, n, m);
arm.names = cell(1, {designs});
for i = 1:{designs}
    arm.names{{i}} = data.designs(i).name;
    k = size(data.designs(i).K, 2) - n;
    arm.rates{{i}} = data.designs(i).rates;
    arm.memory{{i}} = strtrim(cellstr(char(data.designs(i).states)));
    arm.memory{{i}} = arm.memory{{i}}(1:k);
    arm.gain{{i}} = periodic(data.t, data.designs(i).K, data.period, m, n + k);
end
check = max(max(abs(arm.A(data.t(2)) - data.A(:, :, 2))));
assert(check <= 1e-9 * max(abs(data.A(:))), 'the splines do not pass through the samples');
if nargin < 1
    return
end
t = phase * arm.period;
arm.frozen = ss(arm.A(t), arm.B(t), eye(n), zeros(n, m), 'StateName', arm.states, ...
    'InputName', arm.inputs, 'OutputName', arm.states);
if ~exist('OCTAVE_VERSION', 'builtin')  % Octave's control package knows no units
    arm.frozen.StateUnit = arm.state_units;
    arm.frozen.InputUnit = arm.input_units;
    arm.frozen.OutputUnit = arm.state_units;
end
for i = 1:{designs}
    k = size(data.designs(i).K, 2) - n;
    input = [arm.B(t); zeros(k, m)];
    loop = [arm.A(t), zeros(n, k); reshape(arm.rates{{i}}, k, n + k)] - input * arm.gain{{i}}(t);
    names = [arm.states(:); arm.memory{{i}}(:)];
    arm.loop{{i}} = ss(loop, input, eye(n + k), zeros(n + k, m), 'StateName', names, ...
        'InputName', arm.inputs, 'OutputName', names, 'Name', arm.names{{i}});
end
end

function f = periodic(t, samples, period, rows, columns)
% A spline through samples (row, column, time){ends}.
t = t(:).';
last = numel(t);
values = reshape(samples, rows * columns, last);
keep = {keep};
times = [t(last - keep + 1:last) - period, t, t(1:keep) + period];
values = [values(:, last - keep + 1:last), values, values(:, 1:keep)];
piecewise = spline(times, values);
f = @(time) reshape(ppval(piecewise, {within}), rows, columns);
end
"""


def matlab_script(data: Path, designs: int, periodic: bool = True, function: str = "load_arm") -> Path:
    """Write the script beside a .mat file that `save` wrote with a number of designs; returns its path."""
    target = data.with_name(f"{function}.m")
    ends = {"keep": 3, "within": "mod(time, period)", "ends": ": a period, so three samples are repeated at either end"}
    once = {
        "keep": 0,
        "within": "min(max(time, 0), t(end))",
        "ends": " of a motion that ends, held before and after it",
    }
    words = {"function": function, "FUNCTION": function.upper(), "data": data.name, "designs": designs} | (
        ends if periodic else once
    )
    target.write_text(SCRIPT.format(version=flexlin.__version__, **words), encoding="utf-8")
    return target
