% Answers a sheet of questions on the reduced tippedisk model, levels 1 to 9, in GNU Octave, or MATLAB from R2016b.
%
%     octave --eval "tippedisk_answers('sheet.csv', 'answers.csv')"
%     matlab -batch "tippedisk_answers('sheet.csv', 'answers.csv')"
%
% Derivatives are complex-step derivatives: the model accepts complex arguments, and imag(f(x + 1e-100i))/1e-100 is
% f'(x) to full accuracy.  The same trick differentiates orbits: it solves their variational equations.
function tippedisk_answers(sheet, output)
  lines = regexp(fileread(sheet), '\r?\n', 'split');
  names = regexp(lines{1}, ',', 'split');
  out = fopen(output, 'w');
  fprintf(out, 'id,from,answer\n');
  memo = containers.Map();
  for i = 2:numel(lines)
    if isempty(lines{i}), continue, end
    row = cell2struct(regexp(lines{i}, ',', 'split'), names, 2);
    [x, memo] = answer(row, memo);
    if isfinite(x), fprintf(out, '%s,doubles,%.17g\n', row.id, x); end
  end
  fclose(out);
end

function [x, memo] = answer(row, memo)
  x = NaN;
  if numel(row.Omega) > 18, return, end                 % a speed that doubles cannot tell from Omega_h
  p = struct('smooth', strcmp(row.friction, 'smooth'), 'side', 0);
  for name = {'r', 'e', 'm', 'A', 'B', 'g', 'mu', 'epsilon', 'Omega'}
    p.(name{1}) = str2double(row.(name{1}));
  end
  y = [str2double(row.beta); str2double(row.gamma); str2double(row.v)];
  % What many questions share is computed once.
  inputs = {row.kind, row.friction, row.equilibrium, row.form};
  key = [sprintf('%s ', inputs{:}), sprintf('%.17g ', p.r, p.e, p.m, p.A, p.B, p.g, p.mu, p.epsilon, p.Omega, y)];
  if ~isKey(memo, key)
    switch row.kind
      case 'rhs', s = rhs(p, y);
      case 'equilibrium', s = equilibrium(p, 2 * strcmp(row.equilibrium, 'inverted') - 1);
      case 'hopf', s = hopf(p);
      case 'harmonic-balance', s = one_harmonic(p, row.form);
      case 'slow-manifold', s = manifold(p, y(1), y(2));
      case 'trajectory', s = walk(p, y, 10, {@section, @(p, y) sin(y(1))}, 2);
      case {'limit-cycle', 'near-heteroclinic'}, s = limit_cycle(p);
      case 'heteroclinic', s = heteroclinic(p);
      otherwise, s = struct();
    end
    memo(key) = s;
  end
  s = memo(key);
  if strcmp(row.kind, 'trajectory'), x = of_trajectory(p, s, row);
  elseif isfield(s, row.quantity), x = s.(row.quantity);
  end
end

% ---- the model ----
function [v_rate, gamma_rate, dv_rate_dv, gamma_y, M, h, f_G, w_y, lambda_Ty] = model(p, y)
  % y has a state in each column, a complex one if you like
  Omega = p.Omega; m = p.m; e = p.e; Bbar = p.B - m * e^2; D = p.A - Bbar; traction = p.mu * m * p.g;
  sb = sin(y(1, :)); cb = cos(y(1, :)); sg = sin(y(2, :)); cg = cos(y(2, :)); v = y(3, :);
  rho = p.r + e * sg; E = m * e * rho; I = Bbar + D * cg .* cg; cb2 = cb .* cb; sc = sb .* cb; swing = m * rho .* rho;
  M = I + swing .* cb2;
  turning = -Omega .* cb .* cg .* (2 * D * sg + E .* (1 - 3 * cb2)); swing = swing .* sc;
  h = Omega .* Omega .* sc .* (I + E .* cb2 .* sg) + v .* (turning + swing .* v);
  f_G = -m * p.g * rho .* cb;
  w_y = rho .* sb;
  gamma_y = w_y .* v - e * Omega .* sb .* sb .* cg;
  gamma_rate = -Omega .* cb;
  if p.smooth
    % The law is analytic on either side of gamma_y = 0; p.side keeps an integration step on one branch.
    side = p.side; if ~side, side = 2 * (real(gamma_y) >= 0) - 1; end
    d = p.epsilon + side .* gamma_y; slope = traction * p.epsilon ./ (d .* d);
  else
    d = p.epsilon; slope = traction / d;
  end
  lambda_Ty = -traction * gamma_y ./ d;
  v_rate = (h + f_G + w_y .* lambda_Ty) ./ M;
  dv_rate_dv = (turning + 2 * swing .* v - slope .* w_y .* w_y) ./ M;
end

function f = field(p, y)                                % a fourth row is the integral of the field's divergence
  [v_rate, gamma_rate, dv_rate_dv] = model(p, y);
  f = [y(3, :); gamma_rate; v_rate];
  if size(y, 1) == 4, f = [f; dv_rate_dv]; end
end

function s = rhs(p, y)
  [s.v_rate, s.gamma_rate, s.dv_rate_dv, s.gamma_y, s.M, s.h, s.f_G, s.w_y, s.lambda_Ty] = model(p, y);
  f = imag(field(p, repmat(y, 1, 3) + 1e-100i * eye(3))) / 1e-100;
  s.dv_rate_dbeta = f(3, 1); s.dv_rate_dgamma = f(3, 2);
end

% ---- equilibria, Hopf point, harmonic balance, slow manifold ----
function [a, drag, reach] = cubic(p, s)                 % characteristic polynomial at (pi/2, s pi/2, 0)
  Bbar = p.B - p.m * p.e^2; reach = p.r + s * p.e;
  drag = p.mu * p.m * p.g * reach / (p.epsilon * Bbar);
  a = [1, drag * reach, p.Omega^2 - p.m * p.g * reach / Bbar, drag * p.e * s * p.Omega^2];
end

function s = equilibrium(p, sign_of_gamma)
  l = roots(cubic(p, sign_of_gamma));
  [~, order] = sortrows([-round(real(l) * 1e6), -imag(l)]);
  for k = 1:3
    s.(sprintf('lambda_%d_re', k)) = real(l(order(k)));
    s.(sprintf('lambda_%d_im', k)) = imag(l(order(k)));
  end
end

function s = hopf(p)
  Bbar = p.B - p.m * p.e^2;
  p.Omega = (p.r + p.e) * sqrt(p.m * p.g / (p.r * Bbar));
  [a, drag] = cubic(p, 1);
  w = sqrt(a(3)); l = 1i * w;
  dl = -(2 * p.Omega * l + 2 * drag * p.e * p.Omega) / (3 * l^2 + 2 * a(2) * l + a(3));
  q = [1; p.Omega / l; l]; q = q / norm(q);             % right and left eigenvectors
  left = [l + a(2), -drag * p.e * p.Omega / l, 1];
  % The field is odd about the equilibrium.  C(q, q, conj q) is twice the coefficient of s^2 t in f(s q + t conj q),
  % a Cauchy integral over two circles.
  e = exp(2i * pi * (0:31) / 32); [S, T] = ndgrid(e, e); R = 0.5;
  x = R * (q * S(:).' + conj(q) * T(:).');
  f = field(p, [pi/2 + x(1, :); pi/2 + x(2, :); x(3, :)]);
  C = 2 * f * (conj(S(:)).^2 .* conj(T(:))) / 32^2 / R^3;
  c1 = left * C / (left * q) / 2;
  s.omega_crit = p.Omega; s.period = 2 * pi / w;
  s.first_lyapunov_coefficient = real(c1) / w; s.transversality = real(dl);
  s.amplitude_squared_slope = 4 * abs(q(1))^2 * real(dl) / real(c1);
  s.period_slope = 2 * pi / w^2 * (imag(dl) - imag(c1) * real(dl) / real(c1));
end

function s = one_harmonic(p, form)                      % the amplitude law at the Hopf point
  Bbar = p.B - p.m * p.e^2; reach = p.r + p.e; consistent = strcmp(form, 'consistent');
  chi = p.A * (p.r - 2 * p.e) - Bbar * (2 * p.r^2 + p.e * reach) / (2 * reach);
  chi = chi + consistent * Bbar * p.e^2 / (2 * reach);
  delta = -(p.r - p.e * ~consistent) * p.Omega^2 / (8 * reach);
  square = -4 * p.e / reach * (Bbar * p.r * p.Omega^2 - p.m * p.g * reach^2) ...
           / (chi * p.Omega^2 + p.m * p.g * p.e * reach);
  s.amplitude = sqrt(square);
  s.frequency = sqrt(p.e / reach * p.Omega^2 + delta * square);
  s.period = 2 * pi / s.frequency;
end

function c = product(a, b)                                % of power series in (beta, gamma), cut off
  c = conv2(a, b); c = c(1:7, 1:7);
end

function s = manifold(p, beta, gamma)
  % v = h_0 + epsilon h_1 + ... in M epsilon v' = -K (v - h_0) + epsilon (Q0 + Q1 v + Q2 v^2), order by order.
  n = (0:6)'; Omega = p.Omega; Bbar = p.B - p.m * p.e^2;
  one = zeros(7); one(1) = 1; sb = zeros(7); cb = sb; sg = sb; cg = sb;
  sb(:, 1) = sin(beta + n * pi/2) ./ factorial(n); cb(:, 1) = cos(beta + n * pi/2) ./ factorial(n);
  sg(1, :) = sin(gamma + n * pi/2) ./ factorial(n); cg(1, :) = cos(gamma + n * pi/2) ./ factorial(n);
  rho = p.r * one + p.e * sg; rho2 = product(rho, rho);
  sc = product(sb, cb); cb2 = product(cb, cb); cbcg = product(cb, cg);
  I = p.A * product(cg, cg) + Bbar * product(sg, sg);
  M = I + p.m * product(rho2, cb2);
  K = p.mu * p.m * p.g * product(rho2, product(sb, sb));
  Q0 = Omega^2 * product(sc, I + p.m * p.e * product(rho, product(cb2, sg))) - p.m * p.g * product(rho, cb);
  Q1 = -Omega * product(cbcg, 2 * (p.A - Bbar) * sg + p.m * p.e * product(rho, 3 * product(sb, sb) - 2 * one));
  Q2 = p.m * product(rho2, sc);
  h = {p.e * Omega * product(product(sb, cg), over(rho))}; total = 0;
  for k = 0:5
    total = total + p.epsilon^k * h{k + 1};
    s.(sprintf('h_%d', k)) = h{k + 1}(1);
    drift = total(2, 1) * total(1) - Omega * cos(beta) * total(1, 2);
    v_rate = model(p, [beta; gamma; total(1)]);
    s.(sprintf('residual_%d', k)) = p.epsilon * (drift - v_rate);
    slope = [h{k + 1}(:, 2:7) .* n(2:7)', zeros(7, 1)];
    right = (k == 0) * Q0 + product(Q1, h{k + 1}) + Omega * product(M, product(cb, slope));
    for i = 0:k
      slope = [h{i + 1}(2:7, :) .* n(2:7); zeros(1, 7)];
      right = right + product(product(Q2, h{i + 1}) - product(M, slope), h{k - i + 1});
    end
    h{k + 2} = product(right, over(K));
  end
end

function x = over(a)                                    % 1/a by Newton's iteration
  x = zeros(7); x(1) = 1 / a(1);
  for k = 1:4, x = 2 * x - product(x, product(a, x)); end
end

% ---- integration ----
function [z, err, f] = gbs(p, y, h)
  % One Gragg-Bulirsch-Stoer step of order 14: midpoint rules with 2, 4, ..., 14 substeps side by side, extrapolated.
  n = size(y, 2); f = field(p, y); T = cell(1, 7);
  Y = repmat(y, 1, 7); S = repmat(h ./ (2:2:14), n, 1); S = repmat(S(:).', size(y, 1), 1);
  if numel(p.Omega) > 1, p.Omega = repmat(p.Omega, 1, 7); end
  a = zeros(size(Y)); b = S .* repmat(f, 1, 7);         % increments, which lose fewer digits
  for k = 1:14
    next = S .* field(p, Y + b);
    if mod(k, 2) == 0
      j = k / 2; mine = (j - 1) * n + (1:n);
      T{j} = (a(:, mine) + b(:, mine) + next(:, mine)) / 2;
      for i = j - 1:-1:1, T{i} = T{i + 1} + (T{i + 1} - T{i}) / ((j / i)^2 - 1); end
    end
    next = a + 2 * next; a = b; b = next;
  end
  z = y + T{1};
  err = sum(sum(abs(real(T{1} - T{2})) ./ (1 + abs(z))));   % a sum, so that a NaN gets through
end

function g = section(~, y), g = y(1) - pi/2; end
function g = turn(~, y), g = y(3); end
function g = slip(p, y), [~, ~, ~, g] = model(p, y); end

function [p, y] = plain(p, y)                           % the orbit itself, without its derivatives
  p.Omega = real(p.Omega(1)); y = real(y(1:3, 1));
end

function w = walk(p, y, tmax, events, last)
  % Follows the orbit to time tmax or to a zero of events{last}; w: points of the solution, zeros of all events.
  w = struct('t', [], 'y', {{}}, 'side', [], 'event', [], 'when', [], 'where', {{}}, 'done', false);
  t = 0; h = 1e-3; TOL = 2e-14; order = [last, setdiff(1:numel(events), last)];
  watched = events; if p.smooth, watched{end + 1} = @slip; end
  while t < tmax && numel(w.t) < 8000 && h > 1e-12
    [q, a] = plain(p, y);
    if p.smooth                                         % the side that the orbit is on, or moves to
      g = slip(q, a); if abs(g) < 1e-12, g = slip(q, a + 1e-6 * field(q, a)); end
      p.side = 2 * (g >= 0) - 1; q.side = p.side;
    end
    [z, err, f] = gbs(p, y, h);
    grow = max(0.1, min(3, 0.9 * (TOL / (err + 1e-30))^(1/13)));
    if ~(err <= TOL), h = h * grow; continue, end
    used = h; b = real(z(1:3, 1)); again = false;
    for k = 1:numel(watched), again = again || dips(q, a, b, real(f(1:3, 1)), h, watched{k}); end
    if again && h > 1e-5, h = h / 2; continue, end
    if p.smooth && p.side * slip(q, b) < 0
      used = locate(q, a, b, h, @slip); z = gbs(p, y, used); b = real(z(1:3, 1));
    else
      h = min(0.05, h * grow);
    end
    w.t(end + 1) = t; w.y{end + 1} = a; w.side(end + 1) = p.side;
    for k = order
      g = events{k}; before = g(q, a);
      if before * g(q, b) < 0 && ~(t == 0 && abs(before) < 1e-9)
        s = locate(q, a, b, used, g);
        w.event(end + 1) = k; w.when(end + 1) = t + s; w.where{end + 1} = gbs(p, y, s);
        if k == last, w.done = true; used = s; z = w.where{end}; b = real(z(1:3, 1)); end
      end
    end
    t = t + used; y = z;
    if w.done, break, end
  end
  w.stop = t;
end

function s = locate(p, y, z, h, g)
  % The length of the step from y, shorter than that to z, that ends on g = 0: regula falsi (Illinois) on exact steps.
  a = 0; b = h; ga = g(p, y); gb = g(p, z);
  for k = 1:60
    s = (a * gb - b * ga) / (gb - ga);
    if s <= min(a, b) || s >= max(a, b) || abs(s - b) < 1e-17, s = b; break, end
    gs = g(p, gbs(p, y, s));
    if gs * gb < 0, a = b; ga = gb; else, ga = ga / 2; end
    if abs(s - b) <= 4e-16 * h, break, end
    b = s; gb = gs;
  end
end

function yes = dips(p, a, b, f, h, g)                   % whether g seems to change its sign twice within the step
  ga = g(p, a); gb = g(p, b); yes = false;
  if ga * gb <= 0, return, end
  da = imag(g(p, a + 1e-100i * f)) / 1e-100 * sign(ga);
  if da >= 0, return, end
  db = imag(g(p, b + 1e-100i * field(p, b))) / 1e-100 * sign(gb);
  yes = db > 0 && min(abs(ga) / da^2, abs(gb) / db^2) < h / (2 * (db - da));
end

function x = of_trajectory(p, w, row)
  x = NaN; t = str2double(row.t); n = str2double(row.n);
  hits = find(w.event == 1 & w.when >= 0.01);           % the start on the section is no crossing
  if strcmp(row.quantity, 'flat_time')
    if w.done, x = w.stop; end
  elseif isfinite(n)
    if n > numel(hits), return, end
    y = w.where{hits(n)};
    x = [w.when(hits(n)), y(2), y(3)] * strcmp(row.quantity, {'crossing_time'; 'crossing_gamma'; 'crossing_v'});
  elseif t <= w.stop
    k = find(w.t <= t, 1, 'last'); p.side = w.side(k);
    x = gbs(p, w.y{k}, t - w.t(k)).' * strcmp(row.quantity, {'beta'; 'gamma'; 'v'});
  end
end

% ---- cycles ----
function [map, D, dt, w] = half_map(p, x)
  % From (pi/2, pi/2 + x(1), x(2)) with v < 0 to the next beta = pi/2, then through the symmetry (beta, gamma, v) ->
  % (pi - beta, pi - gamma, -v): a cycle is a fixed point.  D: derivatives of this map by x and Omega; dt: of the time,
  % whose change projects on the section.
  Y = repmat([pi/2; pi/2 + x(1); x(2); 0], 1, 3); Y(2:3, 1:2) = Y(2:3, 1:2) + 1e-100i * eye(2);
  q = p; q.Omega = p.Omega + [0, 0, 1e-100i];
  w = walk(q, Y, 8, {@section, @turn}, 1);
  if ~w.done, error('the orbit does not return'), end
  z = w.where{w.event == 1}; f = field(p, real(z(:, 1)));
  dt = -imag(z(1, :)) / 1e-100 / f(1);
  map = -(real(z(2:3, 1)) - [pi/2; 0]); D = -(imag(z(2:3, :)) / 1e-100 + f(2:3) * dt);
end

function s = limit_cycle(p)
  b = one_harmonic(p, 'consistent'); starts = []; s = struct();
  if isreal([b.amplitude, b.frequency]), starts = [b.amplitude * p.Omega / b.frequency; -b.amplitude * b.frequency]; end
  w = walk(p, departing(p), 8, {@section}, 1);
  if w.done, starts = [starts, w.where{1}(2:3) - [pi/2; 0]]; end
  for x = starts
    now = 1;
    try
      for k = 1:4, x = half_map(p, x); end              % the cycles attract; then Newton's method
      for k = 1:16
        [map, D, dt, w] = half_map(p, x); dx = (eye(2) - D(:, 1:2)) \ (map - x); before = now; now = norm(dx);
        if now < 1e-13 || (now < 1e-9 && now >= before) || ~(now < 1), break, end
        x = x + dx;
      end
    catch
    end
    if now < 1e-9 && abs(x(1)) > 1e-3, break, end       % small ones are the equilibrium
  end
  if isempty(starts) || ~(now < 1e-9) || abs(x(1)) < 1e-3, return, end
  half = trace(D(:, 1:2)) / 2; z = w.where{w.event == 1}; turns = [w.where{w.event == 2}];
  % The product of the multipliers follows from the divergence (Liouville); a determinant would lose it.
  root = half + sign(half) * sqrt(half^2 - exp(real(z(4, 1))));
  dx = (eye(2) - D(:, 1:2)) \ D(:, 3);
  s.period = 2 * w.stop; s.gamma_bar_0 = x(1); s.v_0 = x(2); s.beta_max = max(abs(real(turns(1, :)) - pi/2));
  s.multiplier_slow = root^2; s.log_multiplier_slow = 2 * log(abs(root));
  s.log_multiplier_fast = 2 * real(z(4, 1)) - s.log_multiplier_slow;
  s.dgamma_bar_0_domega = dx(1); s.dv_0_domega = dx(2); s.dperiod_domega = 2 * dt * [dx; 1];
end

function y = departing(p)                               % a point on the unstable manifold of the saddle
  l = max(real(roots(cubic(p, -1))));
  y = [pi/2; -pi/2; 0] + 1e-6 * [1; p.Omega / l; l];
end

function s = heteroclinic(p)                            % below Omega_h the manifold passes the next saddle, above not
  high = (p.r + p.e) * sqrt(p.m * p.g / (p.r * (p.B - p.m * p.e^2))); low = 0.9 * high;
  away = @(p, y) (y(2) - 3 * pi/2) * (y(1) - pi/2);
  for k = 1:48
    p.Omega = (low + high) / 2;
    w = walk(p, departing(p), 8, {away}, 1);
    if ~w.done, break, end
    if w.where{1}(2) > 3 * pi/2 - 1e-12, low = p.Omega; else, high = p.Omega; end
  end
  s = struct('omega_h', p.Omega); l = sort(roots(cubic(p, -1)));
  s.lambda_ss = l(1); s.lambda_s = l(2); s.lambda_u = l(3);
end
