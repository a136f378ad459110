# A program to start from, in Julia without packages: it answers levels 1 and 6 of a sheet of questions on the reduced
# tippedisk.
#
#     julia client.jl sheet.csv answers.csv
#
# NOT RUN YET, for want of a Julia: it was read line by line against client.f90 and client.mjs, which run.
#
# To grade a program of your own, call it in place of `model` (level 1) and of `advance` (level 6), and add kinds of
# questions to `answer`. What it does not answer stays empty.
using Printf

const STEP = 1e-4                                  # of the integrator [s]
const TINY = 1e-100                                # of a complex step, which gives derivatives to full accuracy

struct Params
    r::Float64; e::Float64; m::Float64; A::Float64; B::Float64; g::Float64; mu::Float64; epsilon::Float64
    Omega::Float64
    smooth::Bool                                   # the friction law: smooth Coulomb rather than linear
end

# ---- the equations of motion at y = [beta, gamma, v], which may be complex ----
function model(p, y)
    m, e, Omega, Bbar = p.m, p.e, p.Omega, p.B - p.m * p.e^2
    sb, cb, sg, cg, v = sin(y[1]), cos(y[1]), sin(y[2]), cos(y[2]), y[3]
    rho = p.r + e * sg
    inertia = p.A * cg^2 + Bbar * sg^2
    M = inertia + m * rho^2 * cb^2
    h = inertia * Omega^2 * sb * cb - 2 * (p.A - Bbar) * Omega * v * cb * sg * cg + m * rho^2 * v^2 * sb * cb +
        m * e * rho * Omega^2 * sb * cb^3 * sg - m * e * rho * (3 * sb^2 - 2) * Omega * v * cb * cg
    f_G = -m * p.g * rho * cb
    w_y = rho * sb
    gamma_y = rho * v * sb - e * Omega * sb^2 * cg
    size = real(gamma_y) < 0 ? -gamma_y : gamma_y
    lambda_Ty = -p.mu * m * p.g * gamma_y / (p.smooth ? size + p.epsilon : p.epsilon)
    gamma_rate = -Omega * cb
    v_rate = (h + f_G + w_y * lambda_Ty) / M
    return (; M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate, v_rate)
end

function field(p, y)
    q = model(p, y)
    return [y[3], q.gamma_rate, q.v_rate]
end

# ---- level 1 ----
function right_hand_side(p, y, quantity)
    for (k, name) in enumerate(("beta", "gamma", "v"))
        if quantity == "dv_rate_d" * name
            z = complex(y)
            z[k] += TINY * im
            return imag(model(p, z).v_rate) / TINY
        end
    end
    return getproperty(model(p, y), Symbol(quantity))
end

# ---- level 6: the classical method of Runge and Kutta, with equal steps of about STEP ----
function advance(p, y, duration)
    steps = max(1, round(Int, duration / STEP))
    h = duration / steps
    for _ in 1:steps
        k1 = field(p, y)
        k2 = field(p, y + h / 2 * k1)
        k3 = field(p, y + h / 2 * k2)
        k4 = field(p, y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    end
    return y
end

# ---- the sheet ----
value(row, name) = isempty(row[name]) ? NaN : parse(Float64, row[name])

function answer(row, last)                         # a number, or NaN; and where the motion asked about has got to
    names = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "Omega")
    p = Params((value(row, name) for name in names)..., row["friction"] == "smooth")
    y = [value(row, "beta"), value(row, "gamma"), value(row, "v")]
    if row["kind"] == "rhs"
        return right_hand_side(p, y, row["quantity"]), last
    end
    place = findfirst(==(row["quantity"]), ("beta", "gamma", "v"))
    if row["kind"] != "trajectory" || place === nothing
        return NaN, last
    end
    inputs, t = (p, y), value(row, "t")
    if last === nothing || last[1] != inputs || t < last[2]
        last = (inputs, 0.0, y)
    end
    if t > last[2]
        last = (inputs, t, advance(p, last[3], t - last[2]))
    end
    return last[3][place], last
end

function main(sheet, output)
    lines = filter(!isempty, strip.(readlines(sheet)))
    names = split(lines[1], ',')
    last = nothing
    open(output, "w") do out
        println(out, "id,from,answer")
        for line in lines[2:end]
            row = Dict{String,String}(zip(names, split(line, ',')))
            x, last = answer(row, last)
            isfinite(x) && @printf(out, "%s,doubles,%.17g\n", row["id"], x)
        end
    end
end

main(ARGS[1], ARGS[2])
