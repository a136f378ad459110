! The tippedisk's limit cycles for AUTO-07p: equations, constants, and one of the reference cycles as the start.
!
!     tippedisk-verify conformance client auto > tippedisk.f90
!     sed -n 's/^!c //p' tippedisk.f90 > c.tippedisk
!     @r tippedisk                                     (or, in AUTO's Python:  run('tippedisk'))
!
! The start is table1/linear/limit-cycle/crit-0.5, half a rad/s below Omega_crit; AUTO follows it down to Omega_h.
! Beside AUTO's own files, cycles.txt gets Omega, the period and the Floquet multipliers (real and imaginary parts)
! with all digits, one line for each converged solution. These are the constants; docs/auto07p.md gives the reasons:
!
!c parnames = {1: 'Omega', 2: 'r', 3: 'e', 4: 'm', 5: 'A', 6: 'B', 7: 'g', 8: 'mu', 9: 'epsilon', 11: 'period'}
!c unames = {1: 'beta', 2: 'gamma', 3: 'v'}
!c NDIM = 3, IPS = 2, IRS = 0, ILP = 1, ISP = 2, ISW = 1
!c ICP = ['Omega', 'period']
!c NTST = 400, NCOL = 4, IAD = 1, IPLT = 0, JAC = 1
!c NMX = 400, NPR = 400, MXBF = 0, IID = 2, ITMX = 9, ITNW = 9, NWTN = 9
!c EPSL = 1e-8, EPSU = 1e-8, EPSS = 1e-9
!c DS = -0.02, DSMIN = 1e-9, DSMAX = 0.1, IADS = 1
!c UZR = {'Omega': [30.186592688644, 30.148868260722501, 30.058868260722501, 30.049868260722501,
!c                  30.048968260722501, 30.048878260722501], 'period': 5}
!c UZSTOP = {'period': 5.5}

module tippedisk
  implicit none
  integer, parameter :: dp = kind(1d0)
  logical, parameter :: smooth = .false.               ! the friction law: linear, or smooth Coulomb
  real(dp), parameter :: start_Omega = 30.386592688644_dp, start_period = 1.0928442711676105_dp
  real(dp), parameter :: start_gamma_bar = 1.716286804861199_dp, start_v = -1.7100021616439025_dp ! at beta = pi/2
  real(dp), parameter :: pi = acos(-1.0_dp), step = 1e-30_dp
contains
  pure function field(u, p) result(f)
    ! beta', gamma' and v', for complex arguments, so that an imaginary step gives exact derivatives
    complex(dp), intent(in) :: u(3), p(9)
    complex(dp) :: f(3), r, e, m, A, Bbar, g, Omega, v, sb, cb, sg, cg, rho, inertia, h, slip, lambda
    Omega = p(1); r = p(2); e = p(3); m = p(4); A = p(5); Bbar = p(6) - m*e**2; g = p(7)
    sb = sin(u(1)); cb = cos(u(1)); sg = sin(u(2)); cg = cos(u(2)); v = u(3)
    rho = r + e*sg
    inertia = A*cg**2 + Bbar*sg**2
    h = inertia*Omega**2*sb*cb - 2*(A - Bbar)*Omega*v*cb*sg*cg + m*rho**2*v**2*sb*cb &
      + m*e*rho*Omega**2*sb*cb**3*sg - m*e*rho*(3*sb**2 - 2)*Omega*v*cb*cg
    slip = rho*v*sb - e*Omega*sb**2*cg
    lambda = -p(8)*m*g/p(9)*slip
    if (smooth) lambda = -p(8)*m*g*slip/(sign(1.0_dp, real(slip))*slip + p(9))
    f = [v, -Omega*cb, (h - m*g*rho*cb + rho*sb*lambda)/(inertia + m*rho**2*cb**2)]
  end function field
end module tippedisk

subroutine FUNC(NDIM, U, ICP, PAR, IJAC, F, DFDU, DFDP)
  use tippedisk
  implicit none
  integer, intent(in) :: NDIM, ICP(*), IJAC
  double precision, intent(in) :: U(NDIM), PAR(*)
  double precision, intent(out) :: F(NDIM)
  double precision, intent(inout) :: DFDU(NDIM, NDIM), DFDP(NDIM, *)
  complex(dp) :: z(12), w(12)
  integer :: k
  z = [U(1:3), PAR(1:9)]
  F = real(field(z(:3), z(4:)))
  if (IJAC == 0) return
  do k = 1, merge(3, 12, IJAC == 1)
    w = z
    w(k) = z(k) + (0, 1)*step
    if (k <= 3) DFDU(:, k) = aimag(field(w(:3), w(4:)))/step
    if (k > 3) DFDP(:, k - 3) = aimag(field(w(:3), w(4:)))/step
  end do
end subroutine FUNC

subroutine STPNT(NDIM, U, PAR, T)
  ! The start at T of its period: the reference state at T = 0, followed by the classical Runge-Kutta method
  use tippedisk
  implicit none
  integer, intent(in) :: NDIM
  double precision, intent(inout) :: U(NDIM), PAR(*)
  double precision, intent(in) :: T
  complex(dp) :: p(9), y(3), k(3, 4)
  real(dp) :: h
  integer :: n, steps
  PAR(1:9) = [start_Omega, 0.045_dp, 2.5e-3_dp, 0.435_dp, 0.249e-3_dp, 0.227e-3_dp, 9.81_dp, 0.3_dp, 0.1_dp]
  PAR(11) = start_period
  p = PAR(1:9)
  y = [pi/2, pi/2 + start_gamma_bar, start_v]
  steps = 1 + int(4000*T)
  h = T*start_period/steps
  do n = 1, steps
    k(:, 1) = field(y, p)
    k(:, 2) = field(y + h/2*k(:, 1), p)
    k(:, 3) = field(y + h/2*k(:, 2), p)
    k(:, 4) = field(y + h*k(:, 3), p)
    y = y + h/6*(k(:, 1) + 2*k(:, 2) + 2*k(:, 3) + k(:, 4))
  end do
  U = real(y)
end subroutine STPNT

subroutine PVLS(NDIM, U, PAR)
  use tippedisk
  implicit none
  integer, intent(in) :: NDIM
  double precision, intent(in) :: U(NDIM)
  double precision, intent(inout) :: PAR(*)
  double precision, external :: GETP
  integer :: k
  logical, save :: first = .true.
  open (17, file='cycles.txt', position=merge('rewind', 'append', first))
  write (17, '(8es25.16e3)') PAR(1), PAR(11), (GETP('EIG', k, U), k = 1, 6)
  close (17)
  first = .false.
end subroutine PVLS

subroutine BCND
end subroutine BCND

subroutine ICND
end subroutine ICND

subroutine FOPT
end subroutine FOPT
