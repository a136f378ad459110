! Answers a sheet of questions on the reduced tippedisk model, levels 1 to 9, in Fortran 2008.
!
!     gfortran -O2 -o client client.f90
!     ./client sheet.csv answers.csv
!
! Derivatives are complex-step derivatives: the model accepts complex arguments, and aimag(f(x + i step))/step is f'(x)
! to full accuracy.  The same trick differentiates orbits: it solves their variational equations.
module tippedisk
  use, intrinsic :: ieee_arithmetic
  implicit none
  integer, parameter :: wp = selected_real_kind(15)
  real(wp), parameter :: pi = acos(-1.0_wp), step = 1e-100_wp
  complex(wp), parameter :: im = (0, 1)
  ! zeros to be found: beta = pi/2, v = 0, flat, beta = pi/2 or gamma = 3 pi/2, gamma_y = 0
  integer, parameter :: section = 1, turn = 2, flat = 3, away = 4, slip = 5
  type :: params
    logical :: smooth
    integer :: side = 0
    real(wp) :: r, e, m, A, B, g, mu, eps
    complex(wp) :: Omega(3)
  end type
  type :: orbit
    integer :: n = 0, hits = 0, last = 0      ! last: which zero ended it
    logical :: done = .false.
    real(wp) :: t(8000), y(3, 8000), when(2000), end = 0
    integer :: side(8000), what(2000)
    complex(wp) :: at(4, 3, 2000)
  end type
  character(28) :: names(24)                ! what is known of the entry at hand
  real(wp) :: values(24)
  integer :: known = 0
contains
  subroutine put(name, value)
    character(*), intent(in) :: name
    real(wp), intent(in) :: value
    known = known + 1; names(known) = name; values(known) = value
  end subroutine

  ! ---- the model ----
  ! q: M, h, f_G, w_y, gamma_y, gamma_rate, lambda_Ty, v_rate, dv_rate_dv
  pure function model(p, Omega, y) result(q)
    type(params), intent(in) :: p
    complex(wp), intent(in) :: Omega, y(:)
    complex(wp) :: q(9), sb, cb, sg, cg, v, rho, I, turning, swing, d
    real(wp) :: Bbar
    Bbar = p%B - p%m*p%e**2; v = y(3)
    sb = sin(y(1)); cb = cos(y(1)); sg = sin(y(2)); cg = cos(y(2))
    rho = p%r + p%e*sg; I = p%A*cg**2 + Bbar*sg**2
    turning = -2*(p%A - Bbar)*Omega*cb*sg*cg - p%m*p%e*rho*(3*sb**2 - 2)*Omega*cb*cg
    swing = p%m*rho**2*sb*cb
    q(1) = I + p%m*rho**2*cb**2
    q(2) = I*Omega**2*sb*cb + turning*v + swing*v**2 + p%m*p%e*rho*Omega**2*sb*cb**3*sg
    q(3) = -p%m*p%g*rho*cb
    q(4) = rho*sb
    q(5) = rho*v*sb - p%e*Omega*sb**2*cg
    q(6) = -Omega*cb
    d = p%eps
    ! The smooth law is analytic on either side of gamma_y = 0; side keeps an integration step on one branch.
    if (p%smooth) d = d + merge(real(p%side, wp), sign(1.0_wp, real(q(5))), p%side /= 0)*q(5)
    q(7) = -p%mu*p%m*p%g*q(5)/d
    q(8) = (q(2) + q(3) + q(4)*q(7))/q(1)
    q(9) = (2*swing*v + turning - p%mu*p%m*p%g*p%eps/d**merge(2, 1, p%smooth)/p%eps**merge(0, 1, p%smooth)*q(4)**2)/q(1)
  end function

  pure function field(p, y) result(f)       ! the fourth row is the integral of the field's divergence
    type(params), intent(in) :: p
    complex(wp), intent(in) :: y(:, :)
    complex(wp) :: f(4, size(y, 2)), q(9)
    integer :: k
    do k = 1, size(y, 2)
      q = model(p, p%Omega(k), y(:, k)); f(:, k) = [y(3, k), q(6), q(8), q(9)]
    end do
  end function

  subroutine rhs(p, y)
    type(params), intent(in) :: p
    complex(wp), intent(in) :: y(3)
    complex(wp) :: q(9)
    character(12), parameter :: name(9) = [character(12) :: 'M', 'h', 'f_G', 'w_y', 'gamma_y', 'gamma_rate', &
                                           'lambda_Ty', 'v_rate', 'dv_rate_dv']
    integer :: k
    q = model(p, p%Omega(1), y)
    do k = 1, 9; call put(name(k), real(q(k))); end do
    q = model(p, p%Omega(1), y + im*[step, 0.0_wp, 0.0_wp]); call put('dv_rate_dbeta', aimag(q(8))/step)
    q = model(p, p%Omega(1), y + im*[0.0_wp, step, 0.0_wp]); call put('dv_rate_dgamma', aimag(q(8))/step)
  end subroutine

  ! ---- equilibria, Hopf point, harmonic balance, slow manifold ----
  function cubic(p, s) result(a)            ! x^3 + a(1) x^2 + a(2) x + a(3) at (pi/2, s pi/2, 0), and the drag
    type(params), intent(in) :: p
    integer, intent(in) :: s
    real(wp) :: a(4), Bbar, reach, Omega
    Bbar = p%B - p%m*p%e**2; reach = p%r + s*p%e; Omega = real(p%Omega(1))
    a(4) = p%mu*p%m*p%g*reach/(p%eps*Bbar)
    a(1:3) = [a(4)*reach, Omega**2 - p%m*p%g*reach/Bbar, a(4)*p%e*s*Omega**2]
  end function

  function roots(a) result(x)               ! by Weierstrass's iteration, by falling real, then imaginary part
    real(wp), intent(in) :: a(4)
    complex(wp) :: x(3), hold
    integer :: i, k
    x = (1 + maxval(abs(a(1:3))))**0.5_wp*[(0.4_wp, 0.9_wp), (0.4_wp, 0.9_wp)**2, (0.4_wp, 0.9_wp)**3]
    do k = 1, 300
      do i = 1, 3
        x(i) = x(i) - (((x(i) + a(1))*x(i) + a(2))*x(i) + a(3)) &
               /((x(i) - x(1 + mod(i, 3)))*(x(i) - x(1 + mod(i + 1, 3))))
      end do
    end do
    do k = 1, 3
      i = 1 + mod(k + 1, 2)
      hold = x(i + 1) - x(i)
      if (real(hold) > 1e-7_wp .or. (real(hold) > -1e-7_wp .and. aimag(hold) > 0)) x(i:i + 1) = x(i + 1:i:-1)
    end do
  end function

  subroutine equilibrium(p, s)
    type(params), intent(in) :: p
    integer, intent(in) :: s
    complex(wp) :: l(3)
    integer :: k
    l = roots(cubic(p, s))
    do k = 1, 3
      call put('lambda_'//achar(48 + k)//'_re', real(l(k))); call put('lambda_'//achar(48 + k)//'_im', aimag(l(k)))
    end do
  end subroutine

  pure real(wp) function omega_crit(p)
    type(params), intent(in) :: p
    omega_crit = (p%r + p%e)*sqrt(p%m*p%g/(p%r*(p%B - p%m*p%e**2)))
  end function

  subroutine hopf(p)
    type(params), intent(inout) :: p
    integer, parameter :: n = 32
    real(wp), parameter :: R = 0.5_wp
    complex(wp) :: l, dl, q(3), left(3), C(4), c1, s, t, f(4, 1)
    real(wp) :: a(4), Om, w
    integer :: j, k
    Om = omega_crit(p); p%Omega = Om; a = cubic(p, 1); w = sqrt(a(2)); l = im*w
    dl = -(2*Om*l + 2*a(4)*p%e*Om)/(3*l**2 + 2*a(1)*l + a(2))
    q = [(1.0_wp, 0.0_wp), Om/l, l]; q = q/sqrt(sum(abs(q)**2))
    left = [l + a(1), -a(4)*p%e*Om/l, (1.0_wp, 0.0_wp)]
    ! The field is odd about the equilibrium.  C(q, q, conjg(q)) is twice the coefficient of s^2 t in
    ! f(s q + t conjg(q)), a Cauchy integral over two circles.
    C = 0
    do j = 1, n
      do k = 1, n
        s = exp(2*pi*im*j/n); t = exp(2*pi*im*k/n)
        f = field(p, reshape([pi/2, pi/2, 0.0_wp] + R*(s*q + t*conjg(q)), [3, 1]))
        C = C + 2*f(:, 1)*conjg(s**2*t)/n**2/R**3
      end do
    end do
    c1 = sum(left*C(1:3))/sum(left*q)/2
    call put('omega_crit', Om); call put('period', 2*pi/w); call put('transversality', real(dl))
    call put('first_lyapunov_coefficient', real(c1)/w)
    call put('amplitude_squared_slope', 4*abs(q(1))**2*real(dl)/real(c1))
    call put('period_slope', 2*pi/w**2*(aimag(dl) - aimag(c1)*real(dl)/real(c1)))
  end subroutine

  subroutine balance(p, consistent, amplitude, frequency)       ! the one-harmonic law; NaN where it has no cycle
    type(params), intent(in) :: p
    logical, intent(in) :: consistent
    real(wp), intent(out) :: amplitude, frequency
    real(wp) :: Bbar, reach, chi, square, Omega
    Bbar = p%B - p%m*p%e**2; reach = p%r + p%e; Omega = real(p%Omega(1))
    chi = p%A*(p%r - 2*p%e) - Bbar*(2*p%r**2 + p%e*reach - merge(p%e**2, 0.0_wp, consistent))/(2*reach)
    square = -4*p%e/reach*(Bbar*p%r*Omega**2 - p%m*p%g*reach**2)/(chi*Omega**2 + p%m*p%g*p%e*reach)
    amplitude = sqrt(square)
    frequency = Omega*sqrt(p%e/reach - (p%r - merge(0.0_wp, p%e, consistent))/(8*reach)*square)
  end subroutine

  pure function times(a, b) result(c)       ! of power series in (beta, gamma), cut off
    real(wp), intent(in) :: a(0:6, 0:6), b(0:6, 0:6)
    real(wp) :: c(0:6, 0:6)
    integer :: i, j
    c = 0
    do i = 0, 6
      do j = 0, 6
        c(i:, j:) = c(i:, j:) + a(i, j)*b(:6 - i, :6 - j)
      end do
    end do
  end function

  pure function over(a) result(x)           ! 1/a by Newton's iteration
    real(wp), intent(in) :: a(0:6, 0:6)
    real(wp) :: x(0:6, 0:6)
    integer :: k
    x = 0; x(0, 0) = 1/a(0, 0)
    do k = 1, 4; x = 2*x - times(x, times(a, x)); end do
  end function

  pure function slope_of(a) result(c)       ! by beta
    real(wp), intent(in) :: a(0:6, 0:6)
    real(wp) :: c(0:6, 0:6)
    integer :: k
    c(6, :) = 0
    do k = 1, 6; c(k - 1, :) = k*a(k, :); end do
  end function

  subroutine manifold(p, b0, g0)
    ! v = h_0 + epsilon h_1 + ... in M epsilon v' = -K (v - h_0) + epsilon (Q0 + Q1 v + Q2 v^2), order by order
    type(params), intent(in) :: p
    real(wp), intent(in) :: b0, g0
    real(wp), dimension(0:6, 0:6) :: sb, cb, sg, cg, one, rho, rho2, cb2, I, M, K, Q0, Q1, Q2, total, right, slope
    real(wp) :: h(0:6, 0:6, 0:6), Om, Bbar
    complex(wp) :: q(9)
    integer :: j, n
    Om = real(p%Omega(1)); Bbar = p%B - p%m*p%e**2
    one = 0; one(0, 0) = 1; sb = 0; cb = 0; sg = 0; cg = 0; total = 0
    do n = 0, 6
      sb(n, 0) = sin(b0 + n*pi/2)/gamma(n + 1.0_wp); cb(n, 0) = cos(b0 + n*pi/2)/gamma(n + 1.0_wp)
      sg(0, n) = sin(g0 + n*pi/2)/gamma(n + 1.0_wp); cg(0, n) = cos(g0 + n*pi/2)/gamma(n + 1.0_wp)
    end do
    rho = p%r*one + p%e*sg; rho2 = times(rho, rho); cb2 = times(cb, cb)
    I = p%A*times(cg, cg) + Bbar*times(sg, sg)
    M = I + p%m*times(rho2, cb2)
    K = p%mu*p%m*p%g*times(rho2, times(sb, sb))
    Q0 = Om**2*times(times(sb, cb), I + p%m*p%e*times(rho, times(cb2, sg))) - p%m*p%g*times(rho, cb)
    Q1 = -Om*times(times(cb, cg), 2*(p%A - Bbar)*sg + p%m*p%e*times(rho, 3*times(sb, sb) - 2*one))
    Q2 = p%m*times(rho2, times(sb, cb))
    h(:, :, 0) = p%e*Om*times(times(sb, cg), over(rho))
    do n = 0, 5
      total = total + p%eps**n*h(:, :, n)
      q = model(p, p%Omega(1), cmplx([b0, g0, total(0, 0)], kind=wp))
      call put('h_'//achar(48 + n), h(0, 0, n))
      call put('residual_'//achar(48 + n), p%eps*(total(1, 0)*total(0, 0) - Om*cos(b0)*total(0, 1) - real(q(8))))
      right = times(Q1, h(:, :, n)) + Om*times(M, times(cb, transpose(slope_of(transpose(h(:, :, n))))))
      if (n == 0) right = right + Q0
      do j = 0, n
        slope = slope_of(h(:, :, j))
        right = right + times(times(Q2, h(:, :, j)) - times(M, slope), h(:, :, n - j))
      end do
      h(:, :, n + 1) = times(right, over(K))
    end do
  end subroutine

  ! ---- integration ----
  subroutine gbs(p, y, h, z, error)
    ! One Gragg-Bulirsch-Stoer step of order 14: midpoint rules with 2, 4, ..., 14 substeps, extrapolated.
    type(params), intent(in) :: p
    complex(wp), intent(in) :: y(:, :)
    real(wp), intent(in) :: h
    complex(wp), intent(out) :: z(:, :)
    real(wp), intent(out) :: error
    complex(wp), dimension(4, size(y, 2)) :: f, a, b, next
    complex(wp) :: T(4, size(y, 2), 7)
    real(wp) :: s
    integer :: j, k
    f = field(p, y)
    do j = 1, 7
      s = h/(2*j); a = 0; b = s*f           ! increments, which lose fewer digits
      do k = 2, 2*j
        next = a + 2*s*field(p, y + b); a = b; b = next
      end do
      T(:, :, j) = (a + b + s*field(p, y + b))/2
      do k = j - 1, 1, -1
        T(:, :, k) = T(:, :, k + 1) + (T(:, :, k + 1) - T(:, :, k))/((real(j, wp)/k)**2 - 1)
      end do
    end do
    z = y + T(:, :, 1)
    error = sum(abs(real(T(:, :, 1) - T(:, :, 2)))/(1 + abs(z)))          ! a sum, so that a NaN gets through
  end subroutine

  pure complex(wp) function zero_of(p, k, y) result(g)
    type(params), intent(in) :: p
    integer, intent(in) :: k
    complex(wp), intent(in) :: y(:)
    complex(wp) :: q(9)
    select case (k)
    case (section); g = y(1) - pi/2
    case (turn); g = y(3)
    case (flat); g = sin(y(1))
    case (away); g = (y(2) - 3*pi/2)*(y(1) - pi/2)
    case default; q = model(p, p%Omega(1), y); g = q(5)
    end select
  end function

  pure logical function dips(p, k, a, b, h)     ! whether zero_of seems to change its sign twice within the step
    type(params), intent(in) :: p
    integer, intent(in) :: k
    complex(wp), intent(in) :: a(:, :), b(:, :)
    real(wp), intent(in) :: h
    complex(wp) :: f(4, 1)
    real(wp) :: ga, gb, da, db
    ga = real(zero_of(p, k, a(:, 1))); gb = real(zero_of(p, k, b(:, 1))); dips = .false.
    if (ga*gb <= 0) return
    f = field(p, a); da = aimag(zero_of(p, k, a(:, 1) + im*step*f(:, 1)))/step*sign(1.0_wp, ga)
    f = field(p, b); db = aimag(zero_of(p, k, b(:, 1) + im*step*f(:, 1)))/step*sign(1.0_wp, ga)
    if (da < 0 .and. db > 0) dips = min(abs(ga)/da**2, abs(gb)/db**2) < h/(2*(db - da))
  end function

  real(wp) function located(p, k, y, z, h) result(s)
    ! The length of the step from y, shorter than that to z, that ends on a zero: regula falsi (Illinois), exact steps.
    type(params), intent(in) :: p
    integer, intent(in) :: k
    complex(wp), intent(in) :: y(:, :), z(:, :)
    real(wp), intent(in) :: h
    complex(wp) :: x(4, 1)
    real(wp) :: a, b, ga, gb, gs, error
    integer :: n
    a = 0; b = h; ga = real(zero_of(p, k, y(:, 1))); gb = real(zero_of(p, k, z(:, 1)))
    do n = 1, 60
      s = (a*gb - b*ga)/(gb - ga)
      if (s <= min(a, b) .or. s >= max(a, b)) then; s = b; return; end if
      call gbs(p, y, s, x, error); gs = real(zero_of(p, k, x(:, 1)))
      if (gs*gb < 0) then; a = b; ga = gb; else; ga = ga/2; end if
      if (abs(s - b) <= 4e-16_wp*h) return
      b = s; gb = gs
    end do
  end function

  subroutine walk(p0, y0, tmax, events, w)
    ! Follows the orbit to time tmax or to a zero of events(1); w: points of the solution, zeros of all events.
    type(params), intent(in) :: p0
    complex(wp), intent(in) :: y0(:, :)
    real(wp), intent(in) :: tmax
    integer, intent(in) :: events(:)
    type(orbit), intent(out) :: w
    type(params) :: p, q
    complex(wp), dimension(4, size(y0, 2)) :: y, z
    complex(wp), dimension(4, 1) :: a, b
    real(wp) :: t, h, used, error, grow, before, s
    logical :: again
    integer :: k
    p = p0; y = y0; t = 0; h = 1e-3_wp
    do while (t < tmax .and. w%n < 8000 .and. h > 1e-12_wp)
      q = p; q%Omega = real(p%Omega(1)); a(:, 1) = real(y(:, 1))          ! the orbit itself
      if (p%smooth) then                    ! the side that the orbit is on, or moves to
        s = real(zero_of(q, slip, a(:, 1)))
        if (abs(s) < 1e-12_wp) then; b = a + 1e-6_wp*field(q, a); s = real(zero_of(q, slip, b(:, 1))); end if
        p%side = merge(1, -1, s >= 0); q%side = p%side
      end if
      call gbs(p, y, h, z, error)
      grow = max(0.1_wp, min(3.0_wp, 0.9_wp*(2e-14_wp/(error + 1e-30_wp))**(1/13.0_wp)))
      if (.not. error <= 2e-14_wp) then; h = h*grow; cycle; end if
      used = h; b(:, 1) = real(z(:, 1)); again = .false.
      do k = 1, size(events); again = again .or. dips(q, events(k), a, b, h); end do
      if (p%smooth) again = again .or. dips(q, slip, a, b, h)
      if (again .and. h > 1e-5_wp) then; h = h/2; cycle; end if
      if (p%smooth .and. p%side*real(zero_of(q, slip, b(:, 1))) < 0) then
        used = located(q, slip, a, b, h); call gbs(p, y, used, z, error); b(:, 1) = real(z(:, 1))
      else
        h = min(0.05_wp, h*grow)
      end if
      w%n = w%n + 1; w%t(w%n) = t; w%y(:, w%n) = real(a(:3, 1)); w%side(w%n) = p%side
      do k = 1, size(events)
        before = real(zero_of(q, events(k), a(:, 1)))
        if (before*real(zero_of(q, events(k), b(:, 1))) >= 0 .or. (w%n == 1 .and. abs(before) < 1e-9_wp)) cycle
        if (w%hits == size(w%what)) cycle
        s = located(q, events(k), a, b, used)
        w%hits = w%hits + 1; w%what(w%hits) = events(k); w%when(w%hits) = t + s
        call gbs(p, y, s, w%at(:, :size(y, 2), w%hits), error)
        if (k > 1) cycle
        w%done = .true.; w%last = w%hits; used = s; z = w%at(:, :size(y, 2), w%hits); b(:, 1) = real(z(:, 1))
      end do
      t = t + used; y = z
      if (w%done) exit
    end do
    w%end = t
  end subroutine

  real(wp) function of_trajectory(p0, w, quantity, t, n) result(x)        ! NaN: no answer
    type(params), intent(in) :: p0
    type(orbit), intent(in) :: w
    character(*), intent(in) :: quantity
    real(wp), intent(in) :: t
    integer, intent(in) :: n
    type(params) :: p
    complex(wp) :: z(4, 1), y(4, 1)
    real(wp) :: error, x4(4)
    integer :: k, count
    x = ieee_value(x, ieee_quiet_nan)
    if (quantity == 'flat_time') then
      if (w%done) x = w%end
    else if (index(quantity, 'crossing') == 1) then
      count = 0
      do k = 1, w%hits                      ! the start on the section is no crossing
        if (w%what(k) == section .and. w%when(k) >= 0.01_wp) count = count + 1
        if (count == n) then
          x4 = [real(w%at(:3, 1, k)), w%when(k)]
          x = x4(merge(4, merge(2, 3, quantity == 'crossing_gamma'), quantity == 'crossing_time')); return
        end if
      end do
    else if (t <= w%end) then
      k = maxloc(w%t(:w%n), 1, w%t(:w%n) <= t); p = p0; p%side = w%side(k)
      y = 0; y(:3, 1) = w%y(:, k); call gbs(p, y, t - w%t(k), z, error)
      x = real(z(merge(1, merge(2, 3, quantity == 'gamma'), quantity == 'beta'), 1))
    end if
  end function

  ! ---- cycles ----
  ! From (pi/2, pi/2 + x(1), x(2)) with v < 0 to the next beta = pi/2, then through the symmetry (beta, gamma, v) ->
  ! (pi - beta, pi - gamma, -v): a cycle is a fixed point.  D: derivatives of this half map by x and Omega; dt: of the
  ! time, whose change projects on the section.
  subroutine half_map(p0, x, map, D, dt, w)
    type(params), intent(in) :: p0
    real(wp), intent(in) :: x(2)
    real(wp), intent(out) :: map(2), D(2, 3), dt(3)
    type(orbit), intent(out) :: w
    type(params) :: p
    complex(wp) :: y(4, 3), f(4, 1)
    integer :: k
    p = p0; p%Omega(3) = p%Omega(3) + im*step
    do k = 1, 3; y(:, k) = [pi/2, pi/2 + x(1), x(2), 0.0_wp]; end do
    y(2, 1) = y(2, 1) + im*step; y(3, 2) = y(3, 2) + im*step
    call walk(p, y, 8.0_wp, [section, turn], w)
    if (.not. w%done) return
    y = w%at(:, :, w%last); f = field(p0, y(:, :1)); dt = -aimag(y(1, :))/step/real(f(1, 1))
    map = -[real(y(2, 1)) - pi/2, real(y(3, 1))]
    do k = 1, 3; D(:, k) = -aimag(y(2:3, k))/step - real(f(2:3, 1))*dt(k); end do
  end subroutine

  pure function solved(A, b) result(x)      ! of two equations
    real(wp), intent(in) :: A(2, 2), b(2)
    real(wp) :: x(2)
    x = [A(2, 2)*b(1) - A(1, 2)*b(2), A(1, 1)*b(2) - A(2, 1)*b(1)]/(A(1, 1)*A(2, 2) - A(1, 2)*A(2, 1))
  end function

  function departing(p) result(y)           ! a point on the unstable manifold of the saddle
    type(params), intent(in) :: p
    complex(wp) :: y(4, 1), l(3)
    l = roots(cubic(p, -1)); l = real(l(1))
    y(:, 1) = [pi/2, -pi/2, 0.0_wp, 0.0_wp] + 1e-6_wp*[1 + 0*im, p%Omega(1)/l(1), l(1), 0*im]
  end function

  subroutine limit_cycle(p)
    type(params), intent(in) :: p
    type(orbit), allocatable :: w
    real(wp) :: x(2), D(2, 3), dt(3), dx(2), map(2), amplitude, frequency, before, now, half, root, divergence, E(2, 2)
    integer :: try, k
    allocate (w); E = reshape([1, 0, 0, 1], [2, 2])
    do try = 1, 2
      if (try == 1) then
        call balance(p, .true., amplitude, frequency)
        x = [amplitude*real(p%Omega(1))/frequency, -amplitude*frequency]
      else
        call walk(p, departing(p), 8.0_wp, [section], w)
        if (.not. w%done) return
        x = real(w%at(2:3, 1, w%last)) - [pi/2, 0.0_wp]
      end if
      if (.not. abs(x(1)) < 9) cycle        ! the law may have no cycle
      now = 1
      do k = 1, 20                          ! the cycles attract; then Newton's method
        call half_map(p, x, map, D, dt, w)
        if (.not. w%done) exit
        if (k <= 4) then; x = map; cycle; end if
        dx = solved(E - D(:, 1:2), map - x); before = now; now = norm2(dx)
        if (now < 1e-13_wp .or. (now < 1e-9_wp .and. now >= before) .or. .not. now < 1) exit
        x = x + dx
      end do
      if (.not. w%done .or. .not. now < 1e-9_wp .or. abs(x(1)) < 1e-3_wp) cycle     ! the last is the equilibrium
      half = (D(1, 1) + D(2, 2))/2; divergence = real(w%at(4, 1, w%last))
      ! The product of the multipliers follows from the divergence (Liouville); a determinant would lose it.
      root = half + sign(sqrt(half**2 - exp(divergence)), half); dx = solved(E - D(:, 1:2), D(:, 3))
      call put('period', 2*w%end); call put('gamma_bar_0', x(1)); call put('v_0', x(2))
      call put('beta_max', maxval(abs(real(w%at(1, 1, :w%hits)) - pi/2), w%what(:w%hits) == turn))
      call put('multiplier_slow', root**2); call put('log_multiplier_slow', 2*log(abs(root)))
      call put('log_multiplier_fast', 2*(divergence - log(abs(root))))
      call put('dgamma_bar_0_domega', dx(1)); call put('dv_0_domega', dx(2))
      call put('dperiod_domega', 2*dot_product(dt, [dx, 1.0_wp]))
      return
    end do
  end subroutine

  real(wp) function omega_h(p0)             ! below it the saddle's manifold passes the next saddle, above it does not
    type(params), intent(in) :: p0
    type(params) :: p
    type(orbit), allocatable :: w
    real(wp) :: low, high
    integer :: k
    allocate (w); p = p0; high = omega_crit(p); low = 0.9_wp*high
    do k = 1, 48
      p%Omega = (low + high)/2; omega_h = real(p%Omega(1))
      call walk(p, departing(p), 8.0_wp, [away], w)
      if (.not. w%done) return
      if (real(w%at(2, 1, 1)) > 3*pi/2 - 1e-12_wp) then; low = omega_h; else; high = omega_h; end if
    end do
  end function

  subroutine heteroclinic(p)
    type(params), intent(inout) :: p
    complex(wp) :: l(3)
    p%Omega = omega_h(p); l = roots(cubic(p, -1))
    call put('omega_h', real(p%Omega(1)))
    call put('lambda_u', real(l(1))); call put('lambda_s', real(l(2))); call put('lambda_ss', real(l(3)))
  end subroutine
end module

program client
  use tippedisk
  implicit none
  character(100) :: sheet, answers, names_of(40), row(40), form
  character(2000) :: line
  character(400) :: key, last
  type(params) :: p
  type(orbit), allocatable :: w
  real(wp) :: y(3), x, amplitude, frequency
  integer :: status, k, in, out
  call get_command_argument(1, sheet); call get_command_argument(2, answers)
  open (newunit=in, file=sheet, status='old', action='read'); open (newunit=out, file=answers, action='write')
  read (in, '(a)') line; call split(line, names_of); last = ''; allocate (w)
  write (out, '(a)') 'id,from,answer'
  do
    read (in, '(a)', iostat=status) line
    if (status /= 0) exit
    call split(line, row); form = text('form')
    if (len_trim(text('Omega')) > 18) cycle   ! a speed that doubles cannot tell from Omega_h
    key = row(1)(:index(row(1), '/', back=.true.))
    if (key /= last) then                   ! rows of one entry follow each other: it is computed once
      last = key; known = 0
      p%smooth = text('friction') == 'smooth'; p%side = 0; p%Omega = number('Omega')
      p%r = number('r'); p%e = number('e'); p%m = number('m'); p%A = number('A'); p%B = number('B')
      p%g = number('g'); p%mu = number('mu'); p%eps = number('epsilon')
      y = [number('beta'), number('gamma'), number('v')]
      select case (text('kind'))
      case ('rhs'); call rhs(p, cmplx(y, kind=wp))
      case ('equilibrium'); call equilibrium(p, merge(1, -1, text('equilibrium') == 'inverted'))
      case ('hopf'); call hopf(p)
      case ('harmonic-balance')
        call balance(p, form == 'consistent', amplitude, frequency)
        call put('amplitude', amplitude); call put('frequency', frequency); call put('period', 2*pi/frequency)
      case ('slow-manifold'); call manifold(p, y(1), y(2))
      case ('trajectory')
        call walk(p, reshape(cmplx([y, 0.0_wp], kind=wp), [4, 1]), 10.0_wp, [flat, section], w)
      case ('limit-cycle', 'near-heteroclinic'); call limit_cycle(p)
      case ('heteroclinic'); call heteroclinic(p)
      end select
    end if
    x = ieee_value(x, ieee_quiet_nan)
    do k = 1, known; if (names(k) == text('quantity')) x = values(k); end do
    if (text('kind') == 'trajectory') x = of_trajectory(p, w, text('quantity'), number('t'), nint(number('n')))
    if (ieee_is_finite(x)) then
      write (line, '(es26.16e3)') x; write (out, '(4a)') trim(row(1)), ',doubles,', trim(adjustl(line))
    end if
  end do
contains
  subroutine split(line, parts)             ! at the commas
    character(*), intent(in) :: line
    character(*), intent(out) :: parts(:)
    integer :: i, k, n
    i = 1; parts = ''
    do k = 1, size(parts)
      n = scan(line(i:)//',', ','//achar(13)); parts(k) = line(i:i + n - 2); i = i + n
      if (i > len_trim(line)) exit
    end do
  end subroutine

  function text(name)                       ! of the column
    character(*), intent(in) :: name
    character(100) :: text
    text = row(max(1, findloc(names_of, name, 1)))
  end function

  real(wp) function number(name)            ! 0 where the column is empty
    character(*), intent(in) :: name
    character(100) :: field
    number = 0; field = text(name)
    if (field /= '') read (field, *) number
  end function
end program
