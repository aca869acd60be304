"""Slow slip by injection into a fault with rate-and-state friction, after benchmark BP6-QD-A of the SCEC SEAS project.

Antiplane shear of an unbounded body; the fault |z| < L has regularised rate-and-state friction with the aging law and radiation
damping, beyond it is locked. At z = 0 fluid comes at a rate q0 until t_off; along the fault
    p = q0/(beta phi sqrt(alpha)) (G(z, t) - G(z, t - t_off)),
    G(z, t) = sqrt(t) (exp(-z^2/(4 alpha t))/sqrt(pi) - |z|/sqrt(4 alpha t) erfc(|z|/sqrt(4 alpha t)))
Method: one slip a cell (displacement discontinuities), stress at the middles, DOP853 of scipy in slip and the logarithm of the
state, the rate from the balance of traction by Newton's method at each evaluation. Writes injection_rate_state.json: slip, logarithm
of the rate and pressure at z = 0 and 1 km with n and 2n cells; lengths in km where it says so, else SI with MPa."""
import json
import sys
import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import erfc

DAY = 86400.0
P = dict(sigma=50.0, a=0.007, b=0.005, Dc=0.004, f0=0.6, V0=1e-6, Vinit=1e-12, tau0=29.38, mu=32040.0, cs=3464.0,
         q0=1.25e-6, t_off=100 * DAY, alpha=0.1, beta_phi=1e-3, L=6000.0)
TIMES = [25, 50, 75, 100, 125, 150, 200]


def pressure(z, t):
    def g(t):
        if t <= 0:
            return np.zeros_like(z)
        s = np.abs(z) / np.sqrt(4 * P["alpha"] * t)
        return np.sqrt(t) * (np.exp(-s * s) / np.sqrt(np.pi) - s * erfc(s))
    return P["q0"] / (P["beta_phi"] * np.sqrt(P["alpha"])) * (g(t) - g(t - P["t_off"]))


def solve(n):
    """n cells on 0 < z < L, mirrored."""
    h = P["L"] / n
    z = h * (np.arange(n) + 0.5)
    kernel = lambda d: P["mu"] / (2 * np.pi) * (1 / (d - h / 2) - 1 / (d + h / 2))
    K = kernel(z[:, None] - z[None, :]) + kernel(z[:, None] + z[None, :])
    eta = P["mu"] / (2 * P["cs"])
    a, b, sigma, f0, V0, Dc = (P[k] for k in ("a", "b", "sigma", "f0", "V0", "Dc"))
    w = np.full(n, np.log(P["Vinit"] / V0))
    # the state from the initial traction; psi is the logarithm of V0 theta/Dc
    psi0 = (a * np.log(2 * np.sinh((P["tau0"] - eta * P["Vinit"]) / (a * sigma)) * V0 / P["Vinit"]) - f0) / b
    guess = [w]

    def rate(t, slip, psi):
        load = P["tau0"] + K @ slip
        s = sigma - pressure(z, t)
        w = guess[0].copy()
        for _ in range(100):
            x = 0.5 * np.exp(w + (f0 + b * psi) / a)
            r = s * a * np.arcsinh(x) + eta * V0 * np.exp(w) - load
            d = s * a * x / np.sqrt(1 + x * x) + eta * V0 * np.exp(w)
            step = np.clip(r / d, -3, 3)
            w -= step
            if np.abs(step).max() < 1e-12:
                break
        guess[0] = w
        return w

    def f(t, y):
        slip, psi = y[:n], y[n:]
        w = rate(t, slip, psi)
        return np.concatenate([V0 * np.exp(w), V0 / Dc * (np.exp(-psi) - np.exp(w))])

    y0 = np.concatenate([np.zeros(n), np.full(n, psi0)])
    out = solve_ivp(f, (0, TIMES[-1] * DAY), y0, method="DOP853", rtol=1e-7, atol=np.r_[np.full(n, 1e-10), np.full(n, 1e-7)],
                    t_eval=[t * DAY for t in TIMES])
    rows = []
    near = lambda v, x: float(np.interp(x, z, v)) if x > 0 else float((9 * v[0] - v[1]) / 8)
    for t, y in zip(out.t, out.y.T):
        slip, psi = y[:n], y[n:]
        w = rate(t, slip, psi)
        p = pressure(np.array([0.0, 1000.0]), t)
        rows.append(dict(day=t / DAY, slip=near(slip, 0), slip_1km=near(slip, 1000.0), log10_rate=near(w / np.log(10) - 6, 0),
                         p=float(p[0]), p_1km=float(p[1]), slipped_to=float(np.interp(-1e-3, -slip, z)), potency=float(2 * h * slip.sum())))
    print(n, out.nfev, file=sys.stderr)
    return rows


if __name__ == "__main__":
    made = {n: solve(n) for n in (120, 240, 480)}
    for n, rows in made.items():
        print(n)
        for row in rows:
            print("  ", row)
    json.dump(dict(parameters=P, cells=480, rows=made[480], rows_of_half_the_cells=made[240], _how=__doc__), open("injection_rate_state.json", "w"), indent=1)
