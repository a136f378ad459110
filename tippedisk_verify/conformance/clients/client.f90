! A program to start from, in Fortran 2008: it answers levels 1 and 6 of a sheet of questions on the reduced tippedisk.
!
!     gfortran -O2 -o client client.f90
!     ./client sheet.csv answers.csv
!
! To grade a program of your own, call it in place of "model" (level 1) and of "advance" (level 6), and add kinds of
! questions to the main program. What it does not answer stays empty.
module tippedisk
  implicit none
  integer, parameter :: wp = selected_real_kind(15)
  real(wp), parameter :: step = 1e-4_wp                ! of the integrator [s]
  type :: params
    real(wp) :: r, e, m, A, B, g, mu, epsilon, Omega
    logical :: smooth                       ! the friction law: smooth Coulomb rather than linear
  end type
  type :: terms                             ! of the equations of motion
    complex(wp) :: M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate
  end type
contains
  ! ---- the equations of motion, at y = (beta, gamma, v); complex for the sake of "derivative" ----
  pure type(terms) function model(p, y) result(q)
    type(params), intent(in) :: p
    complex(wp), intent(in) :: y(3)
    complex(wp) :: sb, cb, sg, cg, v, rho, inertia, slip
    real(wp) :: Bbar, Omega, m, e
    Omega = p%Omega; m = p%m; e = p%e; Bbar = p%B - m*e**2
    sb = sin(y(1)); cb = cos(y(1)); sg = sin(y(2)); cg = cos(y(2)); v = y(3)
    rho = p%r + e*sg; inertia = p%A*cg**2 + Bbar*sg**2
    q%M = inertia + m*rho**2*cb**2
    q%h = inertia*Omega**2*sb*cb - 2*(p%A - Bbar)*Omega*v*cb*sg*cg + m*rho**2*v**2*sb*cb &
          + m*e*rho*Omega**2*sb*cb**3*sg - m*e*rho*(3*sb**2 - 2)*Omega*v*cb*cg
    q%f_G = -m*p%g*rho*cb
    q%w_y = rho*sb
    q%gamma_y = rho*v*sb - e*Omega*sb**2*cg
    slip = 0; if (p%smooth) slip = sign(1.0_wp, real(q%gamma_y))*q%gamma_y         ! |gamma_y|
    q%lambda_Ty = -p%mu*m*p%g*q%gamma_y/(slip + p%epsilon)
    q%gamma_rate = -Omega*cb
    q%v_rate = (q%h + q%f_G + q%w_y*q%lambda_Ty)/q%M
  end function

  pure real(wp) function derivative(p, y, k)        ! of v_rate by y(k), to full accuracy: a complex step
    type(params), intent(in) :: p
    real(wp), intent(in) :: y(3)
    integer, intent(in) :: k
    complex(wp) :: z(3)
    type(terms) :: q
    z = y; z(k) = z(k) + (0, 1e-100_wp); q = model(p, z); derivative = aimag(q%v_rate)/1e-100_wp
  end function

  pure function field(p, y) result(f)
    type(params), intent(in) :: p
    real(wp), intent(in) :: y(3)
    real(wp) :: f(3)
    type(terms) :: q
    q = model(p, cmplx(y, kind=wp)); f = [y(3), real(q%gamma_rate), real(q%v_rate)]
  end function

  ! ---- level 1 ----
  real(wp) function right_hand_side(p, y, quantity) result(x)
    type(params), intent(in) :: p
    real(wp), intent(in) :: y(3)
    character(*), intent(in) :: quantity
    type(terms) :: q
    q = model(p, cmplx(y, kind=wp))
    select case (quantity)
    case ('M'); x = real(q%M)
    case ('h'); x = real(q%h)
    case ('f_G'); x = real(q%f_G)
    case ('w_y'); x = real(q%w_y)
    case ('gamma_y'); x = real(q%gamma_y)
    case ('lambda_Ty'); x = real(q%lambda_Ty)
    case ('gamma_rate'); x = real(q%gamma_rate)
    case ('v_rate'); x = real(q%v_rate)
    case ('dv_rate_dbeta'); x = derivative(p, y, 1)
    case ('dv_rate_dgamma'); x = derivative(p, y, 2)
    case ('dv_rate_dv'); x = derivative(p, y, 3)
    case default; x = huge(x)                                ! no answer
    end select
  end function

  ! ---- level 6: the classical method of Runge and Kutta, with equal steps of about "step" ----
  subroutine advance(p, y, duration)
    type(params), intent(in) :: p
    real(wp), intent(inout) :: y(3)
    real(wp), intent(in) :: duration
    real(wp) :: k1(3), k2(3), k3(3), k4(3), h
    integer :: n, steps
    steps = max(1, nint(duration/step)); h = duration/steps
    do n = 1, steps
      k1 = field(p, y); k2 = field(p, y + h/2*k1); k3 = field(p, y + h/2*k2); k4 = field(p, y + h*k3)
      y = y + h/6*(k1 + 2*k2 + 2*k3 + k4)
    end do
  end subroutine
end module

program client
  use tippedisk
  implicit none
  integer, parameter :: columns = 25
  character(200) :: sheet, output, names(columns), cells(columns), last_inputs
  character(2000) :: line
  character(5), parameter :: coordinates(3) = ['beta ', 'gamma', 'v    ']
  type(params) :: p
  real(wp) :: y(3), state(3), t, last_t, x
  integer :: ask, answers, status
  call get_command_argument(1, sheet); open (newunit=ask, file=sheet, status='old', action='read')
  call get_command_argument(2, output); open (newunit=answers, file=output, status='replace', action='write')
  write (answers, '(a)') 'id,from,answer'; read (ask, '(a)') line; call split(line, names); last_inputs = ''; last_t = 0
  do
    read (ask, '(a)', iostat=status) line; if (status /= 0) exit
    call split(line, cells)
    p = params(value('r'), value('e'), value('m'), value('A'), value('B'), value('g'), value('mu'), value('epsilon'), &
               value('Omega'), text('friction') == 'smooth')
    y = [value('beta'), value('gamma'), value('v')]; x = huge(x)
    select case (text('kind'))
    case ('rhs'); x = right_hand_side(p, y, trim(text('quantity')))
    case ('trajectory')                                        ! goes on from the time asked about last
      t = value('t'); line = trim(text('friction'))//text('Omega')//text('beta')//text('gamma')//text('v')
      if (line /= last_inputs .or. t < last_t) then
        last_inputs = line(:200); last_t = 0; state = y
      end if
      if (t > last_t) call advance(p, state, t - last_t)
      last_t = t
      if (any(text('quantity') == coordinates)) x = state(findloc(coordinates == text('quantity'), .true., 1))
    end select
    if (abs(x) < huge(x)) write (answers, '(a, ",doubles,", es25.16e3)') trim(text('id')), x
  end do
contains
  subroutine split(from, into)                                 ! at the commas
    character(*), intent(in) :: from
    character(*), intent(out) :: into(:)
    integer :: k, first, last
    into = ''; first = 1
    do k = 1, size(into)
      last = first - 2 + index(from(first:)//',', ',')
      into(k) = from(first:last); first = last + 2
      if (first > len_trim(from)) exit
    end do
  end subroutine

  character(200) function text(name)                           ! the cell below this name
    character(*), intent(in) :: name
    text = cells(findloc(names == name, .true., 1))
  end function

  real(wp) function value(name)                                ! zero where nothing is
    character(*), intent(in) :: name
    value = 0; if (text(name) /= '') read (cells(findloc(names == name, .true., 1)), *) value
  end function
end program
