// A listric fault in a plane: an arc of radius 5 from the top (dip 60 degrees) to a depth of 2.42 (dip 10 degrees), where
// it ends inside the body; lengths in km
// made into listric.msh by: gmsh -2 -order 2 listric.geo -format msh22 -bin
W = 10;
H = 5;
R = 5;
dip = Pi/3;
end = Pi/18;
Point(1) = {0, -H, 0};
Point(2) = {W, -H, 0};
Point(3) = {W, 0, 0};
Point(4) = {3, 0, 0};
Point(5) = {0, 0, 0};
Point(6) = {3 + R*(Sin(dip) - Sin(end)), R*(Cos(dip) - Cos(end)), 0};
Point(7) = {3 + R*Sin(dip), R*Cos(dip), 0};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 5};
Line(5) = {5, 1};
Circle(6) = {4, 7, 6};
Curve Loop(1) = {1, 2, 3, 4, 5};
Plane Surface(1) = {1};
Curve{6} In Surface{1};
Physical Surface("rock") = {1};
Physical Curve("listric") = {6};
Physical Curve("bottom") = {1};
Physical Curve("east") = {2};
Physical Curve("top") = {3, 4};
Physical Curve("west") = {5};
// cells grow in proportion to their distance from the fault and its ends
Field[1] = Distance;
Field[1].PointsList = {4, 6};
Field[2] = Distance;
Field[2].CurvesList = {6};
Field[2].Sampling = 400;
Field[3] = MathEval;
Field[3].F = "min(0.03 + 0.2*F1, 0.2 + 0.25*F2)";
Background Field = 3;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
