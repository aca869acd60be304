"""Temperature of a layer of gouge between two half-spaces that slide past each other, friction falling with temperature.

    m dTf/dt = p V (f0 - drop Tf) - h (Tf - Ta) - h (Tf - Tb),  Ta, Tb: half-spaces with effusivities ea, eb, e = sqrt(k c)
In the plane of Laplace a half-space answers the flux q with T = q/(e sqrt(s)), so that h Tf - q = h q/(e sqrt(s)):
    Tf = (p V f0/s)/(m s + p V drop + sum h e sqrt(s)/(h + e sqrt(s)))
Inverted by the method of Talbot in mpmath with 40 digits, and checked by that of Stehfest. Writes friction_heat.json."""
import json
import mpmath as mp

mp.mp.dps = 40
P = dict(p=50, V=0.1, f0=0.6, drop=5e-4, m=5e-4, h=2e-2, k_a=2.5e-6, c_a=2.7, k_b=4e-6, c_b=2)
N = {k: mp.mpf(repr(v)) for k, v in P.items()}
E = {b: mp.sqrt(N[f"k_{b}"] * N[f"c_{b}"]) for b in "ab"}


def share(b, s):
    return N["h"] * E[b] * mp.sqrt(s) / (N["h"] + E[b] * mp.sqrt(s))


def gouge(s):
    q = N["p"] * N["V"]
    return q * N["f0"] / s / (N["m"] * s + q * N["drop"] + share("a", s) + share("b", s))


def flux(b):
    return lambda s: gouge(s) * share(b, s)


def side(b):
    return lambda s: gouge(s) * share(b, s) / (E[b] * mp.sqrt(s))


if __name__ == "__main__":
    rows = []
    for t in ("0.1", "0.5", "1"):
        t = mp.mpf(t)
        row = dict(t=float(t))
        for name, of in (("Tf", gouge), ("Ta", side("a")), ("Tb", side("b")), ("flux_a", flux("a")), ("flux_b", flux("b"))):
            value = mp.invertlaplace(of, t, method="talbot")
            other = mp.invertlaplace(of, t, method="stehfest")
            assert abs(other / value - 1) < 1e-8, (name, t, value, other)
            row[name] = float(value)
        row["traction"] = float(N["p"] * (N["f0"] - N["drop"] * mp.mpf(row["Tf"])))
        rows.append(row)
        print(row)
    json.dump(dict(parameters=P, rows=rows, _how=__doc__), open("friction_heat.json", "w"), indent=1)
