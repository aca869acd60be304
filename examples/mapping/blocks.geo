// Two blocks one on the other whose meshes do not match: 5 columns below, 15 above (each face above lies over one
// face below), 7 above in the second; lengths in m
// made into blocks.msh by: gmsh -2 blocks.geo -format msh22
Point(1) = {0, 0, 0};
Point(2) = {1, 0, 0};
Point(3) = {1, 0.5, 0};
Point(4) = {0, 0.5, 0};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Transfinite Curve {1, 3} = 6;
Transfinite Curve {2, 4} = 4;
Transfinite Surface {1};
Recombine Surface {1};
Point(5) = {0, 0.5, 0};
Point(6) = {1, 0.5, 0};
Point(7) = {1, 1, 0};
Point(8) = {0, 1, 0};
Line(5) = {5, 6};
Line(6) = {6, 7};
Line(7) = {7, 8};
Line(8) = {8, 5};
Curve Loop(2) = {5, 6, 7, 8};
Plane Surface(2) = {2};
Transfinite Curve {5, 7} = 16;
Transfinite Curve {6, 8} = 5;
Transfinite Surface {2};
Recombine Surface {2};
Physical Surface("lower") = {1};
Physical Surface("upper") = {2};
Physical Curve("base") = {1};
Physical Curve("lower_face") = {3};
Physical Curve("upper_face") = {5};
Physical Curve("top") = {7};
Physical Curve("sides") = {2, 4, 6, 8};
