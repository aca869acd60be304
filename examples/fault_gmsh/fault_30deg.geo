// Two blocks with a fault inclined by 30 degrees from the vertical; lengths in m
// made into fault_30deg.msh by: gmsh -3 fault_30deg.geo -format msh22 -bin
h = 0.9;
Point(1) = {-3, 0, 0, h};
Point(2) = {-1.154700538379, 0, 0, h};
Point(3) = {3, 0, 0, h};
Point(4) = {-3, 0, 4, h};
Point(5) = {1.154700538379, 0, 4, h};
Point(6) = {3, 0, 4, h};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {4, 5};
Line(4) = {5, 6};
Line(5) = {1, 4};
Line(6) = {2, 5};
Line(7) = {3, 6};
Curve Loop(1) = {1, 6, -3, -5};
Plane Surface(1) = {1};
Curve Loop(2) = {2, 7, -4, -6};
Plane Surface(2) = {2};
left[] = Extrude {0, 4, 0} { Surface{1}; };
right[] = Extrude {0, 4, 0} { Surface{2}; };
// an extrusion gives the opposite face, the body, and the sides in the order of the loop
Physical Volume("left") = {left[1]};
Physical Volume("right") = {right[1]};
Physical Surface("bottom") = {left[2], right[2]};
Physical Surface("fault_plane") = {left[3]};
Physical Surface("west") = {left[5]};
Physical Surface("east") = {right[3]};
Physical Surface("top") = {right[4]};
