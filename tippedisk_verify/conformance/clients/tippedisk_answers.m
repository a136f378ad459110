% A program to start from, in GNU Octave, or MATLAB from R2016b: it answers levels 1 and 6 of a sheet of questions on
% the reduced tippedisk.
%
%     octave --eval "tippedisk_answers('sheet.csv', 'answers.csv')"
%     matlab -batch "tippedisk_answers('sheet.csv', 'answers.csv')"
%
% To grade a program of your own, call it in place of "model" (level 1) and of "trajectory" (level 6), and add kinds of
% questions to "answer". What it does not answer stays empty.
function tippedisk_answers(sheet, output)
  lines = regexp(fileread(sheet), '\r?\n', 'split');
  names = regexp(lines{1}, ',', 'split');
  rows = {};
  for i = 2:numel(lines)
    if ~isempty(lines{i}), rows{end + 1} = cell2struct(regexp(lines{i}, ',', 'split'), names, 2); end
  end
  out = fopen(output, 'w');
  fprintf(out, 'id,from,answer\n');
  memo = containers.Map();
  for i = 1:numel(rows)
    [x, memo] = answer(rows{i}, rows, memo);
    if isfinite(x), fprintf(out, '%s,doubles,%.17g\n', rows{i}.id, x); end
  end
  fclose(out);
end

function [x, memo] = answer(row, rows, memo)             % a number, or NaN
  x = NaN;
  p = struct('smooth', strcmp(row.friction, 'smooth'));
  for name = {'r', 'e', 'm', 'A', 'B', 'g', 'mu', 'epsilon', 'Omega'}
    p.(name{1}) = str2double(row.(name{1}));
  end
  y = [str2double(row.beta); str2double(row.gamma); str2double(row.v)];
  place = find(strcmp(row.quantity, {'beta', 'gamma', 'v'}));
  if strcmp(row.kind, 'rhs')
    s = right_hand_side(p, y);
    if isfield(s, row.quantity), x = s.(row.quantity); end
  elseif strcmp(row.kind, 'trajectory') && ~isempty(place)
    key = inputs_of(row);
    if ~isKey(memo, key)                                  % all times at which this motion is asked for, in one run
      times = [];
      for i = 1:numel(rows)
        if strcmp(rows{i}.kind, 'trajectory') && strcmp(inputs_of(rows{i}), key)
          times(end + 1) = str2double(rows{i}.t);
        end
      end
      memo(key) = trajectory(p, y, unique(times(isfinite(times))));
    end
    found = memo(key);
    k = find(found(:, 1) == str2double(row.t));
    if ~isempty(k), x = found(k(1), place + 1); end
  end
end

function key = inputs_of(row)
  key = strjoin({row.set, row.friction, row.Omega, row.beta, row.gamma, row.v}, ' ');
end

% ---- the equations of motion at y = [beta; gamma; v], which may be complex ----
function q = model(p, y)
  m = p.m; e = p.e; Omega = p.Omega; Bbar = p.B - m * e^2;
  sb = sin(y(1)); cb = cos(y(1)); sg = sin(y(2)); cg = cos(y(2)); v = y(3);
  rho = p.r + e * sg;
  inertia = p.A * cg^2 + Bbar * sg^2;
  q.M = inertia + m * rho^2 * cb^2;
  q.h = inertia * Omega^2 * sb * cb - 2 * (p.A - Bbar) * Omega * v * cb * sg * cg + m * rho^2 * v^2 * sb * cb ...
        + m * e * rho * Omega^2 * sb * cb^3 * sg - m * e * rho * (3 * sb^2 - 2) * Omega * v * cb * cg;
  q.f_G = -m * p.g * rho * cb;
  q.w_y = rho * sb;
  q.gamma_y = rho * v * sb - e * Omega * sb^2 * cg;
  d = p.epsilon;
  if p.smooth, d = d + sign(real(q.gamma_y)) * q.gamma_y; end
  q.lambda_Ty = -p.mu * m * p.g * q.gamma_y / d;
  q.gamma_rate = -Omega * cb;
  q.v_rate = (q.h + q.f_G + q.w_y * q.lambda_Ty) / q.M;
end

% ---- level 1: the terms, and the derivatives of v_rate to full accuracy, by a complex step ----
function q = right_hand_side(p, y)
  q = model(p, y);
  names = {'beta', 'gamma', 'v'};
  for k = 1:3
    z = y; z(k) = z(k) + 1e-100i;
    ahead = model(p, z);
    q.(['dv_rate_d' names{k}]) = imag(ahead.v_rate) / 1e-100;
  end
end

% ---- level 6: rows [t, beta, gamma, v] at rising times ----
function rows = trajectory(p, y, times)
  options = odeset('RelTol', 1e-11, 'AbsTol', 1e-13);
  [t, states] = ode45(@(t, y) field(p, y), [0, times(times > 0), max(times) + 1e-3], y, options);
  rows = [t, states];
end

function f = field(p, y)
  q = model(p, y);
  f = [y(3); q.gamma_rate; q.v_rate];
end
