! Answers questions on parts of the right-hand side over a pipe (docs/protocol.md), in Fortran 2008:
!
!     gfortran -O2 -o answerer answerer.f90
!     tippedisk-verify conformance run --levels 1 -- ./answerer
program answerer
  use, intrinsic :: iso_fortran_env, only: output_unit, wp => real64
  implicit none
  character(4000) :: line
  character(30) :: answer
  real(wp) :: rho, x
  integer :: status
  do
    read (*, '(a)', iostat=status) line
    if (status /= 0) exit
    rho = number('r') + number('e')*sin(number('gamma')); answer = 'null'
    select case (text('quantity'))
    case ('w_y'); x = rho*sin(number('beta'))
    case ('f_G'); x = -number('m')*number('g')*rho*cos(number('beta'))
    case ('gamma_rate'); x = -number('Omega')*cos(number('beta'))
    case ('gamma_y')
      x = rho*number('v')*sin(number('beta')) - number('e')*number('Omega')*sin(number('beta'))**2*cos(number('gamma'))
    case default; x = huge(x)
    end select
    if (x < huge(x)) write (answer, '(es25.16e3)') x
    write (*, '(5a)') '{"id": "', trim(text('id')), '", "answer": ', trim(adjustl(answer)), ', "from": "doubles"}'
    flush (output_unit)
  end do
contains
  function text(name)                       ! blank where the question has none
    character(*), intent(in) :: name
    character(300) :: text
    integer :: start
    start = index(line, '"'//name//'": "'); text = ''
    if (start == 0) return
    start = start + len(name) + 5; text = line(start:start + index(line(start:), '"') - 2)
  end function

  real(wp) function number(name)
    character(*), intent(in) :: name
    character(300) :: digits
    digits = text(name); number = 0
    if (digits /= '') read (digits, *) number
  end function
end program
